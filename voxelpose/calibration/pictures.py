"""Output files of a calibration: itself, a report, and pictures of the rig from above and from the
side, the corners of each lens, and each camera's silhouette with the tangent planes of the others.
"""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calib.camera import Camera, FloatArray, Rig
from calib.files import write_rig
from calib.points import nearest_point
from calib.storage.atomic import replacing
from calib.tangency import OutlineTrack, plane_axes
from calib.upright import UprightFrame, up_candidates
from voxelpose.calibration.check import Check
from voxelpose.calibration.lenses import Lens
from voxelpose.results import as_json
from voxelpose.view.images.canvas import (
    FAINT,
    INK,
    LEFT,
    MIDDLE,
    PAPER,
    RIGHT,
    WARNING,
    Colour,
    Image,
    bgr,
    png,
)

_CELLS = 72  # along the longest edge
_SEEN = bgr("#3e5460")  # colour of the volume seen by all cameras
_FILLED, _EMPTY = bgr("#303842"), bgr("#462830")
_ACROSS = 4  # lenses side by side


def rig_picture(rig: Rig, floor: bool = True) -> Image:
    """Picture of a rig, (H, W, 3) uint8 BGR: from above on the left, from the side on the right.

    Shaded is where two cameras or more see, brighter for more of them; from above with a floor a
    standing person, from feet to head.

    Args:
        floor: Whether the world's z is the height above the floor; if not, what is up for the
            cameras is drawn upward.
    """
    rig = rig if floor else UprightFrame.from_up(up_candidates(rig)[0]).rig(rig)
    low, high = _extent(rig, floor)
    longest = float((high - low).max())
    step = longest / _CELLS
    x, y, z = (np.arange(low[k] + step / 2, high[k], step) for k in range(3))
    seen = _seen_by(rig, x, y, z)
    person = np.linspace(0.1, 1.8, 6)
    above = _seen_by(rig, x, y, person).min(axis=2) if floor else seen.max(axis=2)
    with matplotlib.rc_context(_style()):
        figure = Figure((14, 7.5), layout="constrained")
        views = ((1, above, "from above"), (2, seen.max(axis=1), "from the side"))
        for axes, (up, count, title) in zip(figure.subplots(1, 2), views, strict=True):
            axes.set_title(title, loc="left")
            axes.set_aspect("equal")
            axes.set_xlim(low[0], high[0])
            axes.set_ylim(low[up], high[up])
            shade = _shade(count, len(rig))
            axes.imshow(shade, origin="lower", extent=(low[0], high[0], low[up], high[up]))
            axes.grid(color=_rgb(FAINT), alpha=0.25)
            if floor:
                length = 0.08 * longest
                for name, end in (("x", (length, 0)), ("yz"[up - 1], (0, length))):
                    axes.plot((0, end[0]), (0, end[1]), color=_rgb(RIGHT), lw=2)
                    axes.text(*end, name, color=_rgb(RIGHT))
            if floor and up == 2:
                axes.axhline(color=_rgb(MIDDLE), lw=2)
                axes.annotate("floor", (1, 0), xycoords=("axes fraction", "data"), ha="right")
            for camera in rig:
                _draw_camera(axes, camera, up, 0.1 * longest)
        figure.suptitle(f"{len(rig)} cameras, metres", fontsize=18)
        shaded = {1: "seen", 2: "seen by both cameras"}
        caption = shaded.get(len(rig), f"seen by 2 to all {len(rig)} cameras")
        guess = "left: a standing person, from feet to head"
        if not floor:
            guess = "no floor was given: up is a guess, from the cameras"
        figure.supxlabel(f"shade: {caption}; {guess}", color=_rgb(FAINT), fontsize=12)
        return _rendered(figure)


def coverage_picture(lenses: list[Lens]) -> Image:
    """Used corners of every camera, (H, W, 3) uint8 BGR; cells of the image without any are red."""
    columns = min(len(lenses), _ACROSS)
    rows = -(-len(lenses) // columns)
    style: dict[Any, Any] = {**_style(), "xtick.bottom": False, "ytick.left": False}
    with matplotlib.rc_context(style):
        figure = Figure((5.2 * columns, 5 * rows), layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in panels[len(lenses) :]:
            axes.set_axis_off()
        for axes, lens in zip(panels, lenses, strict=False):
            intrinsics, used = lens.intrinsics, lens.used()
            (width, height), centre = intrinsics.camera.size, intrinsics.camera.matrix[:2, 2]
            colours = np.where(intrinsics.coverage[..., None] > 0, _rgb(_FILLED), _rgb(_EMPTY))
            axes.imshow(colours, extent=(-0.5, width - 0.5, height - 0.5, -0.5))
            corners = np.concatenate([view.pixels for view in used.values()])
            axes.plot(*corners.T, ".", color=_rgb(LEFT), ms=3)
            axes.plot(*centre, "+", color=_rgb(INK), ms=12)
            axes.set_title(
                f"{lens.camera}\n{intrinsics.rms_px:.2f} px in {len(used)} pictures, focal length"
                f" {intrinsics.camera.matrix[0, 0]:.0f} px"
            )
            axes.set_xticks([])
            axes.set_yticks([])
        empty = any((lens.intrinsics.coverage == 0).any() for lens in lenses)
        legend = "dots: corners used   red: none here   cross: optical centre"
        figure.supxlabel(legend, color=_rgb(WARNING if empty else FAINT), fontsize=12)
        return _rendered(figure)


def _rgb(colour: Colour) -> tuple[float, ...]:
    """A colour BGR, 0 to 255, as matplotlib has it."""
    return tuple(value / 255 for value in colour[::-1])


def _style() -> dict[Any, Any]:
    ink = dict.fromkeys(("text.color", "xtick.color", "ytick.color"), _rgb(INK))
    paper = dict.fromkeys(("figure.facecolor", "axes.facecolor"), _rgb(PAPER))
    return {**ink, **paper, "axes.edgecolor": _rgb(FAINT)}


def _rendered(figure: Figure) -> Image:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., 2::-1])


def _extent(rig: Rig, floor: bool) -> tuple[FloatArray, FloatArray]:
    """Low and high corner, m, of a box around the cameras and the point they look at."""
    centers = np.array([camera.center_m for camera in rig])
    axes = np.array([camera.rotation[2] for camera in rig])
    # The point nearest to all optical axes; limited for almost parallel axes.
    depth = max(1.0, float(np.ptp(centers, axis=0).max()))
    middle = nearest_point(centers, axes)
    middle = np.clip(middle, centers.min(axis=0) - depth, centers.max(axis=0) + depth)
    points = np.vstack(
        [centers, middle[None], *([np.zeros((1, 3)), [[0, 0, 2.5]]] if floor else [])]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.12 * max(float((high - low).max()), 1.0)
    return low - margin, high + margin


def _seen_by(rig: Rig, x: FloatArray, y: FloatArray, z: FloatArray) -> NDArray[np.int64]:
    """Number (X, Y, Z) int64 of cameras that have each point in their image."""
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    count = np.zeros(len(points), dtype=np.int64)
    for camera in rig:
        pixels, _ = camera.project(points)
        with np.errstate(invalid="ignore"):
            count += ((pixels >= -0.5) & (pixels < np.array(camera.size) - 0.5)).all(axis=1)
    return count.reshape(len(x), len(y), len(z))


def _shade(count: NDArray[np.int64], cameras: int) -> NDArray[np.float64]:
    """Colours (rows, columns, 3) of cells (columns, rows), by how many cameras see each."""
    least = min(2, cameras)
    share = np.clip((count.T[..., None] - least + 1) / (cameras - least + 1), 0, 1)
    return (1 - share) * np.array(_rgb(PAPER)) + share * np.array(_rgb(_SEEN))


def _draw_camera(axes: Axes, camera: Camera, up: int, length: float) -> None:
    """Draws a camera as its viewing pyramid, with its name behind it."""
    width, height = camera.size
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height], [0, 0]], float) - 0.5
    # Without distortion, because wide lenses may have no rays at the corners.
    rays = camera.pinhole().rays(corners)[1]
    rays /= np.abs(rays @ camera.rotation[2])[:, None]
    apex, forward = camera.center_m[[0, up]], camera.rotation[2][[0, up]]
    ends = (camera.center_m + length * rays)[:, [0, up]]
    axes.plot(*ends.T, color=_rgb(LEFT), lw=1)
    for end in ends[:4]:
        axes.plot(*zip(apex, end, strict=True), color=_rgb(LEFT), lw=1)
    axes.plot(*apex, "o", color=_rgb(LEFT), ms=6)
    back = -12 * forward / (np.linalg.norm(forward) + 1e-9)
    side = "right" if back[0] < 0 else "left"
    axes.annotate(
        camera.name, tuple(apex), tuple(back), textcoords="offset points", ha=side, va="center"
    )


def draw_check(check: Check) -> Image:
    """Draws a check, (h, w, 3) uint8 BGR, with a picture per camera and moment.

    The silhouette is tinted. Lines are the tangent planes of the other cameras' silhouettes: they
    touch this one if the cameras agree. Lines of a camera that does not agree are red.
    """
    names, moments, agreement = check.rig.names, sorted(check.checked_frames), check.agreement
    across = 2 if len(names) > 2 else 1
    rows = -(-len(names) // across)
    title = "; ".join(repair.summary for repair in check.repairs) or agreement.summary
    with matplotlib.rc_context(_style()):
        figure = Figure((19, 1 + 9.5 / across * rows), layout="constrained")
        figure.suptitle(agreement.summary if agreement.agrees else title, fontsize=18, wrap=True)
        groups = figure.subfigures(rows, across, squeeze=False).ravel()
        for group, name in zip(groups, names, strict=False):
            line = next(line for line in agreement.table if line.camera == name)
            disagrees = name in agreement.culprits or any(
                name in (repair.camera, repair.with_camera) for repair in check.repairs
            )
            words = f"{name}: {line.error_px:.1f} px from the others"
            words += ", does not agree" * disagrees
            group.suptitle(words, color=_rgb(WARNING if disagrees else INK), fontsize=14)
            panels = group.subplots(1, len(moments), squeeze=False).ravel()
            box = _box([check.checked_frames[moment][name].mask for moment in moments])
            for axes, moment in zip(panels, moments, strict=True):
                _draw_moment(axes, check, name, moment)
                axes.set_axis_off()
                axes.set_xlim(box[0][0], box[1][0])
                axes.set_ylim(box[1][1], box[0][1])
        legend = (
            "lines: where the other cameras' silhouettes say that this one begins and ends; where"
            " cameras agree, they touch it"
        )
        figure.supxlabel(legend, color=_rgb(FAINT), fontsize=12)
        return _rendered(figure)


def _draw_moment(axes: Axes, check: Check, name: str, moment: int) -> None:
    """Draws one camera's picture at one moment, with the lines of the others."""
    checked, camera = check.checked_frames[moment][name], check.rig[name]
    inside = checked.mask[..., None]
    tinted = np.where(inside, 0.5 * checked.frame + 110, 0.55 * checked.frame)
    axes.imshow(tinted[..., ::-1].clip(0, 255).astype(np.uint8))
    time_s = float(check.times_s[np.flatnonzero(check.moments == moment)[0]])
    zoom = np.array(checked.mask.shape[::-1]) / camera.size
    for other, track in check.tracks.items():
        wrong = not {name, other}.isdisjoint(check.agreement.culprits)
        for line in touching_lines(camera, track, time_s) if other != name else ():
            pixels = (line + 0.5) * zoom - 0.5
            axes.plot(*pixels.T, color=_rgb(WARNING if wrong else LEFT), lw=1)


def _box(masks: list[NDArray[np.bool_]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Low and high corner (x, y), working px, of a box around silhouettes, with a border."""
    column, row = np.nonzero(np.any(masks, axis=0))[::-1]
    size = np.array(masks[0].shape[::-1], dtype=np.float64)
    if not len(row):
        return np.zeros(2), size
    # Percentiles, because of flicker far from the body.
    low, high = (np.percentile([column, row], share, axis=1) for share in (1, 99))
    border = 0.35 * max(high - low)
    return np.maximum(low - border, 0), np.minimum(high + border, size)


def touching_lines(camera: Camera, other: OutlineTrack, time_s: float) -> list[NDArray[np.float64]]:
    """Images (N, 2), px, in a camera of the planes that are tangent to the body in another one."""
    baseline = other.camera.center_m - camera.center_m
    baseline = baseline / max(float(np.linalg.norm(baseline)), 1e-9)
    zero = other.toward_body()
    axes = plane_axes(baseline, zero)
    angles, _ = other.tangent_angles(baseline, zero)
    index = int(np.abs(other.time_s - time_s).argmin())
    lines = []
    for angle in angles[index][np.isfinite(angles[index])]:
        normal_ray = np.array([np.cos(angle), np.sin(angle)]) @ axes
        along = np.tan(np.linspace(-1.5, 1.5, 400))
        pixels, _ = camera.project(camera.center_m + normal_ray + along[:, None] * baseline)
        lines.append(pixels)
    return lines


def beside(out: Path, suffix: str) -> Path:
    """Path of an accompanying file, such as calibration_rig.png for calibration.toml."""
    return out.with_name(f"{out.stem}_{suffix}")


def write_calibration(
    rig: Rig,
    out: Path,
    notes: Mapping[str, Any],
    picture: tuple[Path, Image],
    report: tuple[Path, Mapping[str, object]],
) -> None:
    """Writes a calibration, a picture and a report. A failure leaves no partial file. InputError
    where a file cannot be written.

    Args:
        out: The calibration; its suffix selects the format.
        notes: Stored in the calibration, if its format supports that.
        picture: PNG file and what it shows.
        report: JSON file and what it says.
    """
    others = {picture[0]: png(picture[1]), report[0]: as_json(report[1]).encode()}
    with ExitStack() as complete:
        for path, content in others.items():
            complete.enter_context(replacing(path)).write_bytes(content)
        write_rig(rig, out, notes=notes)
