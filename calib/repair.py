"""What happened to a camera that does not agree: moved, its picture scaled, swapped with another, or out of step. And the way back.

Each explanation is tried on the silhouettes themselves; the one that brings agreement is told, with how far it is off.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.agreement import (
    Agreement,
    Evidence,
    Mask,
    Moment,
    OutsideField,
    body_middle,
    body_pieces,
    group_error,
    outline_pixels,
    ray_points,
)
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.extrinsics import apart
from calib.rotation import matrix_from_rodrigues

FloatArray = NDArray[np.float64]

_RAYS = 50
_DEPTHS = 160
_LIKELY_PX = 2.0
_STEP_PX = 1.5  # silhouettes are made of pixels: smaller steps see only steps
_ROUNDS = 15
_ENOUGH = 0.01
_SIMPLER = 1.5  # a simpler explanation wins if its error is at most this times the best one's
_SLACK_PX = 0.03


@dataclass(frozen=True, eq=False)
class Repair:
    """An explanation.

    Attributes:
        camera: Whom it is about.
        words: What happened, with how far.
        before_px: Error of all cameras as they were given.
        after_px: The same if the explanation is believed.
        rig: The rig that agrees, or the given one where it is not the rig that has to change.
        offset_frames: By how many frames the camera is late (its picture shows what the others showed so many frames ago).
    """

    camera: str
    words: str
    before_px: float
    after_px: float
    rig: Rig
    offset_frames: int = 0


def explain(rig: Rig, silhouettes: Mapping[str, Sequence[Mask]], found: Agreement, moments: Sequence[int], most_offset: int = 10) -> Repair:
    """Finds what happened to the culprit of an agreement check.

    Args:
        rig: The cameras.
        silhouettes: By camera, (H, W) bool for every frame, in step.
        found: What `check_agreement` said of it. Without a culprit, only swapped cameras are looked for.
        moments: Frames to look at.
        most_offset: How many frames out of step are tried, each way.

    Returns:
        The best explanation; of two that are about as good, the simpler one.

    Raises:
        InputError: No explanation brings agreement.
    """
    seen = [{name: masks[at] for name, masks in silhouettes.items()} for at in moments]
    tries = _swaps(rig, seen, found)
    if found.culprit is not None:
        tries.append(_out_of_step(rig, silhouettes, found, moments, most_offset))
        if min(one.after_px for one in tries) > _SLACK_PX:  # the rest takes a while
            tries.append(replace_camera(rig, seen, found.culprit, found.error_px))
            tries.append(scale_picture(rig, seen, found.culprit, found.error_px))
    best = min((one.after_px for one in tries), default=np.inf)
    good = [one for one in tries if one.after_px <= _SIMPLER * best + _SLACK_PX and one.after_px < 0.5 * found.error_px]
    if not good:
        raise InputError("no single change brings the cameras to agree: calibrate again, and look at the silhouettes")
    return good[0]


def replace_camera(rig: Rig, moments: Sequence[Moment], name: str, before_px: float) -> Repair:
    """Finds where a camera must stand for its silhouettes to agree with the others' (which are believed).

    Source: least squares on the agreement check's ray errors, six numbers, Gauss and Newton's method with halved steps.
    """
    camera = rig[name]
    # One unit of each number moves the picture by about a pixel.
    pixel = 1 / camera.matrix[0, 0]
    depth = float(np.median([np.linalg.norm(other.center_m - camera.center_m) for other in rig if other.name != name])) / 2

    def moved(x: FloatArray) -> Camera:
        turn = matrix_from_rodrigues(x[:3] * pixel)
        shift = x[3:] * pixel * depth if len(x) == 6 else np.zeros(3)
        return replace(camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation + shift)

    others = _Others(rig, moments, name)
    # A bumped camera has mostly turned, and on one body a turn and a shift look much alike: shifts are left for what turning cannot mend.
    x = _best(others, moved, np.zeros(3))
    if others.errors(moved(x)).mean() > _SLACK_PX:
        x = _best(others, moved, np.concatenate([x, np.zeros(3)]))
    after = moved(x)
    millimetres, degrees = apart(after, camera)
    changed = Rig(tuple(after if one.name == name else one for one in rig))
    words = f"{name} was moved: turned by {degrees:.2f} degrees, shifted by {millimetres:.0f} mm"
    return Repair(name, words, before_px, _error(changed, moments), changed)


def scale_picture(rig: Rig, moments: Sequence[Moment], name: str, before_px: float) -> Repair:
    """Finds by how much a camera's picture was scaled and shifted (letterboxed, cropped, resized) since it was calibrated."""
    camera = rig[name]

    def scaled(x: FloatArray) -> Camera:
        factors = np.diag([*np.exp(x[:2] / max(camera.size) * 2), 1.0])
        middle = (np.array(camera.size) - 1) / 2
        matrix = factors @ (camera.matrix - [[0, 0, middle[0]], [0, 0, middle[1]], [0, 0, 0]])
        matrix[:2, 2] += middle + x[2:]
        return replace(camera, matrix=matrix)

    after = scaled(_best(_Others(rig, moments, name), scaled, np.zeros(4)))
    wide, high = np.diag(after.matrix)[:2] / np.diag(camera.matrix)[:2]
    shift = (after.matrix[:2, 2] - camera.matrix[:2, 2]).round()
    changed = Rig(tuple(after if one.name == name else one for one in rig))
    centre = f"centre shifted by {shift[0]:.0f}, {shift[1]:.0f} px"
    words = f"{name}'s picture was scaled (letterboxed or cropped): {wide:.3f} across, {high:.3f} down, {centre}"
    return Repair(name, words, before_px, _error(changed, moments), changed)


def _swaps(rig: Rig, moments: Sequence[Moment], found: Agreement) -> list[Repair]:
    """Tries every two cameras' videos exchanged; returns the best exchange, if one helps."""
    tries = []
    for at, first in enumerate(rig.names):
        for second in rig.names[at + 1 :]:
            if found.culprit not in (None, first, second) or rig[first].size != rig[second].size:
                continue
            other = {first: second, second: first}
            exchanged = [{other.get(name, name): mask for name, mask in moment.items()} for moment in moments[::2]]
            error = _error(rig, exchanged)
            tries.append(Repair(first, f"the videos of {first} and {second} are swapped", found.error_px, error, rig))
    return [min(tries, key=lambda one: one.after_px)] if tries else []


def _out_of_step(rig: Rig, silhouettes: Mapping[str, Sequence[Mask]], found: Agreement, moments: Sequence[int], most: int) -> Repair:
    """Tries the culprit's video some frames earlier and later."""
    name = str(found.culprit)
    count = min(len(masks) for masks in silhouettes.values())
    errors = {}
    for offset in range(-most, most + 1):
        kept = [at for at in moments[::2] if 0 <= at + offset < count]
        if offset and len(kept) > len(moments[::2]) // 2:
            errors[offset] = _error(rig, [{one: masks[at + offset * (one == name)] for one, masks in silhouettes.items()} for at in kept])
    if not errors:
        return Repair(name, "", found.error_px, np.inf, rig)
    offset = min(errors, key=lambda one: (errors[one], abs(one)))
    words = f"{name} is out of step: {abs(offset)} frames {'late' if offset > 0 else 'early'}"
    return Repair(name, words, found.error_px, errors[offset], rig, offset)


def _error(rig: Rig, moments: Sequence[Moment]) -> float:
    """Returns the error of all cameras."""
    return group_error([Evidence.from_moment(rig, moment) for moment in moments], rig.names)


@dataclass(frozen=True, eq=False)
class _Moment:
    """One moment's likely points (N, 3) on the others' rays, how far outside (N,) px they are, each ray's first one, and the rest."""

    points: FloatArray
    outside: NDArray[np.float32]
    starts: NDArray[np.int64]
    seeing: list[Camera]
    fields: dict[str, OutsideField]
    field: OutsideField
    outline: FloatArray
    middle: FloatArray


class _Others:
    """What the other cameras say of where one camera's silhouettes belong, measured once."""

    def __init__(self, rig: Rig, moments: Sequence[Moment], name: str) -> None:
        """Measures the points on the others' rays, and the silhouettes."""
        self._others = [camera for camera in rig if camera.name != name]
        self._moments: list[_Moment] = []
        for moment in moments:
            bodies = {camera.name: body_pieces(moment[camera.name]) for camera in rig if moment[camera.name].any()}
            seeing = [camera for camera in self._others if camera.name in bodies]
            if name not in bodies or len(seeing) < 2:
                continue
            fields = {one: OutsideField.from_mask(body) for one, body in bodies.items()}
            middle = body_middle(seeing, [bodies[camera.name] for camera in seeing])
            points, outside, counts = [], [], []
            for camera in seeing:
                rays, _ = ray_points(camera, outline_pixels(bodies[camera.name], _RAYS), middle)
                others = [fields[other.name].look_up(other, rays.reshape(-1, 3)) for other in seeing if other is not camera]
                apart_px = np.nan_to_num(np.max(others, axis=0)).reshape(rays.shape[:2])
                # The rest of a ray is where the others say that the body is not.
                likely = apart_px <= apart_px.min(axis=1, keepdims=True) + _LIKELY_PX
                points.append(rays[likely])
                outside.append(apart_px[likely])
                counts.append(likely.sum(axis=1))
            starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))[:-1]])
            outline = outline_pixels(bodies[name], _RAYS)
            one = _Moment(np.concatenate(points), np.concatenate(outside), starts, seeing, fields, fields[name], outline, middle)
            self._moments.append(one)

    def errors(self, camera: Camera) -> FloatArray:
        """Returns the errors, px, of all rays, the camera's own and the others', if it stood so."""
        found = []
        for one in self._moments:
            own = np.nan_to_num(one.field.look_up(camera, one.points))
            found.append(np.minimum.reduceat(np.maximum(one.outside, own), one.starts))
            rays, _ = ray_points(camera, one.outline, one.middle, _DEPTHS)
            others = [one.fields[other.name].look_up(other, rays.reshape(-1, 3)) for other in one.seeing]
            error = np.nan_to_num(np.max(others, axis=0)).reshape(rays.shape[:2]).min(axis=1)
            found.append(np.pad(error, (0, len(one.outline) - len(error))))
        return np.concatenate(found).astype(np.float64) if found else np.zeros(0)


def _best(others: _Others, model: Callable[[FloatArray], Camera], start: FloatArray) -> FloatArray:
    """Minimises the errors over a camera's numbers from a start; returns them."""
    x, count = start.copy(), len(start)
    errors = others.errors(model(x))
    damping = 1.0
    for _ in range(_ROUNDS):
        weights = 1 / np.sqrt(1 + (errors / 10) ** 2)
        steps = _STEP_PX * np.eye(count)
        slope = np.array([(others.errors(model(x + step)) - errors) / _STEP_PX for step in steps]).T
        normal = (slope * weights[:, None]).T @ slope
        downhill = -(slope * weights[:, None]).T @ errors
        for _ in range(6):
            step = np.linalg.solve(normal + damping * np.eye(count) + 0.01 * np.diag(np.diag(normal)), downhill)
            tried = others.errors(model(x + step))
            if _cost(tried) < _cost(errors):
                break
            damping *= 8
        else:
            return x
        gain = _cost(errors) - _cost(tried)
        x, errors, damping = x + step, tried, max(damping / 4, 1e-3)
        if gain < _ENOUGH * _cost(errors) and np.abs(step).max() < 0.2:
            break
    return x


def _cost(errors: FloatArray) -> float:
    """Returns the soft-L1 cost of errors."""
    return float((np.sqrt(1 + (errors / 10) ** 2) - 1).sum())
