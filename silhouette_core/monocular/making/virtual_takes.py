"""Virtual takes: recorded motion of random bodies before random cameras, as silhouettes.

All lengths are in statures, so that what is learned serves every body.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, Float32Array, FloatArray, IndexArray
from silhouette_core.body.joints import (
    EXCHANGED_LANDMARKS,
    LANDMARK_NAMES,
    PART_NAMES,
    without_side,
)
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_AXES, SHAPE_SIGMA, BodySizes
from silhouette_core.image.raster import render_many
from silhouette_core.monocular.making.virtual_defects import (
    cast_shadow,
    passing_defects,
    spoil_silhouettes,
    virtual_seen_joints,
    wall_coloured_places,
)
from silhouette_core.monocular.making.virtual_shading import (
    bare_pixels,
    lit_labels,
    part_colours,
    relative_brightness,
)
from silhouette_core.monocular.proposal.silhouette_features import (
    FULL,
    GRID,
    STATURE_CELLS,
    counted,
    feet_grid,
    level_axes,
    mirrored_seen_codes,
    shading_grid,
)
from silhouette_core.monocular.tuning import VIRTUAL_CAMERAS as CAMERAS
from silhouette_core.monocular.tuning import VIRTUAL_PEOPLE as PEOPLE
from silhouette_core.monocular.tuning import Range
from silhouette_core.motion import kinematics
from silhouette_core.motion.dynamics import FPS
from silhouette_core.motion.motion import Motion

_LENGTHS, _SHORTEST = (60, 110), 12  # frames of a take
_CANVAS_PX = 208
_STATURE_PX = 2 * STATURE_CELLS
_HEAD_TOP = LANDMARK_NAMES.index("head_top")
_SIZE = _CANVAS_PX, _CANVAS_PX
_MATRIX = np.array([[1, 0, (_CANVAS_PX - 1) / 2], [0, 1, (_CANVAS_PX - 1) / 2], [0, 0, 1]], float)
_METRE = 4 / 7  # in statures of 1.75 m
_GIRTHS = np.array(
    [
        axis.along == "girth" or axis.name in ("trunk_width", "trunk_depth", "foot_girth")
        for axis in SHAPE_AXES
    ]
)
_LOOSE = ("pelvis", "lumbar", "abdomen", "thorax", "thigh", "shin", "upper_arm", "clavicle")
_CLOTHED = np.array([any(name in part for name in _LOOSE) for part in PART_NAMES])
# What has the colours of the head, each if all before have: sleeves differ.
_ARM_PARTS = ("hand", "thumb", "fingers"), ("forearm",), ("upper_arm",)
_SKIN_LIKE_PARTS = (
    ("upper_thorax", "thorax", "abdomen", "clavicle", "upper_arm"),
    ("thigh", "shin", "pelvis"),
    ("foot", "toes"),
)


@dataclass(frozen=True, eq=False)
class VirtualTake:
    """T frames of a person before a virtual camera; lengths in statures, the floor at 0."""

    coverage: ByteArray  #: (T, 60, 80) uint8, 0 to 4, the silhouettes, see `coverage_grid`.
    feet: ByteArray  #: (T, 28, 48) uint8, 0 or 4, their lowest parts, see `feet_grid`.
    skin: ByteArray  #: (T, 60, 80) uint8, 0 to 4, what has the colours of the head.
    shading: ByteArray  #: (T, 60, 80) uint8, see `shading_grid`.
    seen: Float32Array  #: (T, 45) float32, joints as a pose network sees them, see `seen_codes`.
    pitch_rad: Float32Array  #: (T,) float32, as in `FrameFeatures`.
    heading_rad: Float32Array  #: (T,) float32, as in `FrameFeatures`.
    anchor: Float32Array  #: (T, 3) float32, as in `FrameFeatures`.
    time_s: FloatArray  #: (T,) float64.
    joints: Float32Array
    """(T, 14, 3) float32, joints but the pelvis, relative to it: right, away, up."""
    offset: Float32Array
    """(T, 3) float32, the pelvis in the window (right, down) at the assumed distance, and the
    logarithm of its true distance over the assumed one."""

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.time_s)


class VirtualBodies:
    """Random bodies around that of a library, with and without wide clothes."""

    def __init__(self, model: BodyModel) -> None:
        """Prepares the templates.

        Args:
            model: body of the library; both sexes are drawn if its sex is unknown.
        """
        sizes = model.sizes
        sexes = ("male", "female") if sizes.sex == "unknown" else (sizes.sex,)
        self._templates = [
            BodyModel.from_sizes(BodySizes(sizes.stature_m, sizes.chest_girth_m, sex))
            for sex in sexes
        ]

    def draw(self, rng: np.random.Generator) -> tuple[BodyModel, FloatArray, float]:
        """Body, its clothed vertices (V, 3) at rest, m, and its stature, m."""
        template = self._templates[int(rng.integers(len(self._templates)))]
        stout = rng.normal(0, PEOPLE.stout)
        body = ~IS_CLOTHING
        shape = _GIRTHS * stout
        shape[body] += rng.normal(0, PEOPLE.spread, np.count_nonzero(body)) * SHAPE_SIGMA[body]
        model = template.reshaped(template.shape + np.clip(shape, *PEOPLE.shape_limits))
        stature = float(model.landmarks_m[_HEAD_TOP, 2] - model.vertices_m[:, 2].min())
        vertices = model.vertices_m
        if rng.random() < 0.5:
            covered = (model.skin_weights * _CLOTHED[model.skin_parts]).sum(axis=1)
            width = rng.uniform(*_in_statures(PEOPLE.clothes_m)) * stature
            vertices = vertices + model.vertex_normals * (width * covered)[:, None]
        return model, vertices, stature


def film_take(motion: Motion, bodies: VirtualBodies, rng: np.random.Generator) -> VirtualTake:
    """Films a motion with a random camera.

    Args:
        motion: T frames, about 30 per second.
        rng: random numbers; the take depends on nothing else.

    Returns:
        The take.
    """
    joints, surface, model = _performed(motion, bodies, rng)
    count = len(joints)
    centre = _camera_place(joints[:, 0, :2], rng)
    toward = surface.mean(axis=1, dtype=np.float64) - centre
    heading = np.arctan2(toward[:, 1], toward[:, 0])
    pitch = np.arctan2(-toward[:, 2], np.hypot(toward[:, 0], toward[:, 1]))
    level = level_axes(heading)
    forward = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    down = np.asarray(np.cross(forward, level[:, 0]), float)
    camera_from_world = np.stack([level[:, 0], down, forward], axis=1)
    placed = np.einsum("tij,tlj->tli", camera_from_world, joints - centre)
    pelvis = placed[:, 0]
    assumed = pelvis[:, 2] * np.exp(_distance_error(count, rng))
    focal = _STATURE_PX * assumed
    viewed = _viewed(surface - centre.astype(np.float32), camera_from_world, focal)
    bare_parts = _bare_parts(rng)
    labels = lit_labels(surface, model.faces, model.face_part, bare_parts, rng)
    images = render_many(viewed, model.faces, labels, _MATRIX, _SIZE)
    masks, bare = (images > 0).view(np.uint8), bare_pixels(images)
    shadow = cast_shadow(surface, rng)
    if shadow is not None:
        fallen = _viewed(shadow - centre.astype(np.float32), camera_from_world, focal)
        masks |= render_many(fallen, model.faces, labels, _MATRIX, _SIZE, cull_back=False) > 0
    _spoil(masks, bare, viewed, part_colours(bare_parts)[_main_parts(model)], rng)
    corners = _window_corners(masks)
    # The window's middle, relative to the canvas's.
    middle = corners + (np.array(GRID[::-1]) * 2 - 1) / 2 - (_CANVAS_PX - 1) / 2
    ray = np.column_stack([middle / focal[:, None], np.ones(count)])
    joints_px = placed[..., :2] / placed[..., 2:] * focal[:, None, None] - middle[:, None]
    joints_px /= _STATURE_PX
    relative = np.matmul(joints[:, 1:] - joints[:, :1], level.transpose(0, 2, 1))
    return VirtualTake(
        window_coverage(masks, corners),
        feet_grid(masks.astype(bool)),
        _skin_grids(bare & masks, masks, corners, rng),
        _shading_grids(relative_brightness(images, rng) * masks, masks, corners, rng),
        virtual_seen_joints(joints_px, rng),
        pitch.astype(np.float32),
        heading.astype(np.float32),
        (centre + assumed[:, None] * np.einsum("tji,tj->ti", camera_from_world, ray)).astype(
            np.float32
        ),
        motion.time_s,
        relative.astype(np.float32),
        np.column_stack([joints_px[:, 0], np.log(pelvis[:, 2] / assumed)]).astype(np.float32),
    )


def _in_statures(lengths_m: Range) -> FloatArray:
    """Lengths in statures of a person of 1.75 m."""
    return np.array(lengths_m) * _METRE


def mirror_image(take: VirtualTake) -> VirtualTake:
    """The take as seen in a mirror: left and right of pictures, body and room exchanged."""
    feet = take.feet[..., ::-1]
    across = np.array([-1, 1, 1], np.float32)
    exchanged = np.array(EXCHANGED_LANDMARKS)[1:] - 1  # without the pelvis
    return replace(
        take,
        coverage=take.coverage[..., ::-1],
        # The window of the feet has one column more on its left, see `feet_grid`.
        feet=np.concatenate([np.zeros_like(feet[..., :1]), feet[..., :-1]], axis=-1),
        skin=take.skin[..., ::-1],
        shading=take.shading[..., ::-1],
        seen=mirrored_seen_codes(take.seen),
        heading_rad=-take.heading_rad,
        anchor=take.anchor * across[[1, 0, 2]],
        joints=take.joints[:, exchanged] * across,
        offset=take.offset * across,
    )


def _performed(
    motion: Motion, bodies: VirtualBodies, rng: np.random.Generator
) -> tuple[FloatArray, Float32Array, BodyModel]:
    """Joints (T, 15, 3) and surfaces (T, V, 3) of a random body in statures, on the floor near the
    middle of the room, and the body.
    """
    model, vertices, stature = bodies.draw(rng)
    rotation, origin = kinematics.forward(
        model, motion.root_m, motion.root_quaternion, motion.angles_rad
    )
    joints = kinematics.landmarks(model, rotation, origin) / stature
    surface = np.empty((len(motion), *vertices.shape), np.float32)
    clothed = replace(model, vertices_m=vertices)
    for frame in range(len(motion)):
        surface[frame] = kinematics.skin(clothed, rotation[frame], origin[frame])
    surface /= stature
    root = joints[:, 0, :2]
    floor = np.quantile(surface[..., 2].min(axis=1), 0.1)
    if rng.random() < CAMERAS.raised:
        floor -= rng.uniform(0, CAMERAS.highest)
    moved = np.array(
        [
            *(root.max(axis=0) + root.min(axis=0)) / 2 + rng.normal(0, CAMERAS.away_m * _METRE, 2),
            floor,
        ]
    )
    return joints - moved, surface - moved.astype(np.float32), model


def _bare_parts(rng: np.random.Generator) -> BoolArray:
    """Whether every part (27,) has the colours of the head."""
    bare = {"head"}
    if rng.random() >= PEOPLE.cap:
        bare |= {"neck"}
        for parts, chance in zip(_ARM_PARTS, PEOPLE.bare_arms, strict=True):
            if rng.random() >= chance:
                break
            bare |= set(parts)
        if rng.random() < PEOPLE.bare_legs:
            bare |= {"shin"}
        if rng.random() < PEOPLE.bare_legs:
            bare |= {"foot", "toes"}
    if rng.random() < PEOPLE.skin_like:  # clothes of the same colours
        bare |= set(_SKIN_LIKE_PARTS[int(rng.integers(len(_SKIN_LIKE_PARTS)))])
    return np.array([without_side(name) in bare for name in PART_NAMES])


def _skin_grids(
    bare: ByteArray, masks: ByteArray, corners: NDArray[np.int32], rng: np.random.Generator
) -> ByteArray:
    """Grids (T, 60, 80) uint8, 0 to 4, of bare parts (T, H, W) 0 or 1 in windows at corners (T, 2):
    the colours of the head are found less surely than these, and elsewhere, too.
    """
    grids = window_coverage(bare, corners).astype(np.float32)
    elsewhere = window_coverage(masks, corners) - grids
    sure = rng.uniform(*PEOPLE.surely_found)
    wrong = rng.uniform(*PEOPLE.wrongly_found) * (rng.random() < PEOPLE.often)
    noise = rng.normal(0, rng.uniform(*PEOPLE.skin_noise), grids.shape).astype(np.float32)
    seen = sure * grids + wrong * elsewhere
    return np.clip(np.rint(seen + noise * (seen > 0) * FULL), 0, FULL).astype(np.uint8)


def _shading_grids(
    brightness: Float32Array, masks: ByteArray, corners: NDArray[np.int32], rng: np.random.Generator
) -> ByteArray:
    """Grids (T, 60, 80) uint8 of relative brightness (T, H, W) in windows at corners (T, 2), with
    exposures and noise that change from frame to frame.
    """
    sums = window_coverage(brightness, corners)
    covered = window_coverage(masks, corners)
    exposure = rng.normal(0, PEOPLE.exposure, len(masks)).astype(np.float32)[:, None, None]
    noise = rng.uniform(*PEOPLE.grain) * rng.standard_normal(sums.shape, np.float32)
    return shading_grid(sums + covered * (exposure + noise))


def _window_corners(masks: ByteArray) -> NDArray[np.int32]:
    """First pixels (T, 2), x and y, of windows about the centroids, rounded to whole pixels, of
    masks (T, H, W), 0 or 1; of an empty one about the image's middle.
    """
    corners, count = np.empty((len(masks), 2), np.int32), masks.sum(axis=(1, 2), dtype=np.int64)
    for k, pixels in enumerate(masks.shape[:0:-1]):
        sums = masks.sum(axis=1 + k, dtype=np.int64) @ np.arange(pixels)
        middle = np.where(count > 0, sums / np.maximum(count, 1), (pixels - 1) / 2)
        corners[:, k] = np.floor(middle - (2 * GRID[1 - k] - 1) / 2 + 0.5)
    return corners


def window_coverage(masks: NDArray, corners: IndexArray) -> NDArray:
    """Coverage (T, 60, 80), 0 to 4, of masks (T, H, W), 0 or 1, in windows whose first pixels, x
    and y, are at corners (T, 2); outside the masks it is 0. Of other images: the sums of the cells.
    """
    rows, columns = 2 * GRID[0], 2 * GRID[1]
    window = np.zeros((len(masks), rows, columns), masks.dtype)
    height, width = masks.shape[1:]
    for mask, (left, top), part in zip(masks, corners, window, strict=True):
        bottom, right = min(top + rows, height), min(left + columns, width)
        inside = mask[max(top, 0) : bottom, max(left, 0) : right]
        part[max(-top, 0) : bottom - top, max(-left, 0) : right - left] = inside
    return counted(window)


def _camera_place(roots: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Place (3,) of a camera that has the person's way (T, 2) before it."""
    azimuth = rng.uniform(0, 2 * np.pi)
    distance = np.exp(rng.uniform(*np.log(_in_statures(CAMERAS.distance_m))))
    height = rng.uniform(*_in_statures(CAMERAS.height_m))
    direction = np.array([np.cos(azimuth), np.sin(azimuth)])
    while np.linalg.norm(roots - distance * direction, axis=1).min() < CAMERAS.nearest_m * _METRE:
        distance *= 1.2
    return np.array([*(distance * direction), height])


def _distance_error(count: int, rng: np.random.Generator) -> FloatArray:
    """Logarithm (T,) of the assumed distance over the true one."""
    error = np.zeros(count)
    constant, steps = rng.normal(0, CAMERAS.wrong), rng.normal(0, CAMERAS.wander, count)
    for frame in range(1, count):
        error[frame] = CAMERAS.steady * error[frame - 1] + steps[frame]
    return constant + error


def _viewed(
    surface: Float32Array, camera_from_world: FloatArray, focal_px: FloatArray
) -> Float32Array:
    """Surfaces (T, V, 3) in the cameras' frames, x and y times the focal length: every frame has
    its own, and all are drawn with one matrix.
    """
    scaled = (
        camera_from_world * np.column_stack([focal_px, focal_px, np.ones_like(focal_px)])[..., None]
    )
    return np.matmul(surface, scaled.transpose(0, 2, 1).astype(np.float32))


def _main_parts(model: BodyModel) -> IndexArray:
    """Part (V,) that moves each vertex most."""
    main = model.skin_weights.argmax(axis=1)[:, None]
    return np.take_along_axis(model.skin_parts, main, axis=1)[:, 0]


def _spoil(
    masks: ByteArray,
    bare: ByteArray,
    viewed: Float32Array,
    colour: IndexArray,
    rng: np.random.Generator,
) -> None:
    """Gives silhouettes and bare parts (T, H, W), in place, the defects of real ones, each its own,
    at the places of vertices (T, V, 3) that have colours (V,).
    """
    points_px = viewed[..., :2] / viewed[..., 2:] + np.float32((_CANVAS_PX - 1) / 2)
    edges, discs = passing_defects(points_px, rng)
    alike = wall_coloured_places(points_px, colour, rng)
    spoil_silhouettes(masks, edges, np.concatenate([alike, discs], axis=1))
    edges, discs = passing_defects(points_px, rng, strange=False)
    spoil_silhouettes(bare, np.zeros_like(edges), discs)


def plan_takes(motions: Sequence[Motion], frames: int, rng: np.random.Generator) -> list[Motion]:
    """Stretches of motion of two to four seconds, 30 frames per second, in random order.

    Args:
        frames: number of frames wanted; every frame is taken equally often, or once more.
    """
    strides = [max(1, round(motion.fps / FPS)) for motion in motions]
    thinned = [one.select(slice(None, None, k)) for one, k in zip(motions, strides, strict=True)]
    thinned = [motion for motion in thinned if len(motion) >= _SHORTEST]
    stretches: list[Motion] = []
    planned = 0
    while thinned and planned < frames:
        this_pass: list[Motion] = []
        for motion in thinned:
            length = int(rng.integers(*_LENGTHS))
            for start in range(-int(rng.integers(0, length)), len(motion), length):
                rows = slice(max(start, 0), start + length)
                if len(motion.root_m[rows]) >= _SHORTEST:
                    this_pass.append(motion.select(rows))
        for chosen in rng.permutation(len(this_pass)):
            if planned < frames:
                stretches.append(this_pass[chosen])
                planned += len(this_pass[chosen])
    return [stretches[chosen] for chosen in rng.permutation(len(stretches))]
