"""Picture of a check: each camera's silhouette with the tangent planes of the other cameras."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.tangency import OutlineTrack
from voxelpose.calibration.check import Check, CheckedFrame
from voxelpose.view.images.canvas import (
    FAINT,
    INK,
    LEFT,
    PAPER,
    WARNING,
    Image,
    stroke,
    text_width,
    write_text,
)

_GAP, _MARGIN, _HEAD, _CAPTION = 8, 28, 104, 30
_WIDEST, _TILE = 1900, 360


def draw_check(check: Check) -> Image:
    """Draws a check, (h, w, 3) uint8 BGR, with a row per camera and a column per moment.

    The silhouette is tinted. Lines are the tangent planes of the other cameras' silhouettes: they
    touch this one if the cameras agree. Lines of a camera that does not agree are red.
    """
    names = list(check.rig.names)
    moments = sorted(check.checked_frames)
    boxes = {
        name: _box([check.checked_frames[moment][name].mask for moment in moments])
        for name in names
    }
    width = min(
        _TILE, (_WIDEST - 2 * _MARGIN) // max(1, len(moments) * _columns(len(names))) - _GAP
    )
    aspect = float(np.median([(high - low)[1] / (high - low)[0] for low, high in boxes.values()]))
    tile = width, round(width * float(np.clip(aspect, 0.6, 1.8)))
    columns = _columns(len(names))
    rows = -(-len(names) // columns)
    group = len(moments) * (tile[0] + _GAP)
    title = _title(check)
    across = max(
        2 * _MARGIN + columns * group + (columns - 1) * 3 * _GAP,
        2 * _MARGIN + text_width(title, 22, True),
    )
    sheet = np.full(
        (_HEAD + rows * (tile[1] + _CAPTION + 2 * _GAP) + _MARGIN // 2, across, 3), PAPER, np.uint8
    )
    write_text(sheet, title, _MARGIN, 42, 22, INK, bold=True)
    legend = (
        "lines: where the other cameras' silhouettes say that this one begins and ends; where"
        " cameras agree, they touch it"
    )
    write_text(sheet, legend, _MARGIN, 70, 14, FAINT)
    for index, name in enumerate(names):
        top = _HEAD + (index // columns) * (tile[1] + _CAPTION + 2 * _GAP)
        left = _MARGIN + (index % columns) * (group + 3 * _GAP)
        _caption(sheet, check, name, left, top + 16)
        for column, moment in enumerate(moments):
            x = left + column * (tile[0] + _GAP)
            sheet[top + _CAPTION : top + _CAPTION + tile[1], x : x + tile[0]] = _tile(
                check, name, moment, boxes[name], tile
            )
    return sheet


def _columns(cameras: int) -> int:
    return 2 if cameras > 2 else 1


def _title(check: Check) -> str:
    if check.agreement.agrees:
        return check.agreement.summary
    return "; ".join(repair.summary for repair in check.repairs) or check.agreement.summary


def _caption(sheet: Image, check: Check, name: str, left: int, base: int) -> None:
    line = next(line for line in check.agreement.table if line.camera == name)
    disagrees = name in check.agreement.culprits or any(
        name in (repair.camera, repair.with_camera) for repair in check.repairs
    )
    write_text(sheet, name, left, base, 16, WARNING if disagrees else INK, bold=True)
    caption = f"{line.error_px:.1f} px from the others" + (", does not agree" if disagrees else "")
    write_text(
        sheet,
        caption,
        left + text_width(name, 16, True) + 14,
        base,
        14,
        WARNING if disagrees else FAINT,
    )


def _box(masks: list[NDArray[np.bool_]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Low and high corner (x, y), working px, of a box around silhouettes, with a border."""
    column, row = np.nonzero(np.any(masks, axis=0))[::-1]
    size = np.array(masks[0].shape[::-1], dtype=np.float64)
    if not len(row):
        return np.zeros(2), size
    # Percentiles, because of flicker far from the body.
    low = np.array([np.percentile(column, 1), np.percentile(row, 1)])
    high = np.array([np.percentile(column, 99), np.percentile(row, 99)])
    border = 0.35 * max(high - low)
    return np.maximum(low - border, 0), np.minimum(high + border, size)


def _tile(
    check: Check,
    name: str,
    moment: int,
    box: tuple[NDArray[np.float64], NDArray[np.float64]],
    tile: tuple[int, int],
) -> Image:
    """Image of one camera at one moment, cropped and annotated."""
    checked: CheckedFrame = check.checked_frames[moment][name]
    low, high = box
    scale = min(tile[0] / (high - low)[0], tile[1] / (high - low)[1])
    shift = np.array(tile) / 2 - scale * (low + high) / 2
    warp = np.column_stack([scale * np.eye(2), shift])
    tinted = (0.55 * checked.frame).astype(np.uint8)
    tinted[checked.mask] = np.clip(0.5 * checked.frame[checked.mask] + 110, 0, 255).astype(np.uint8)
    image = np.asarray(
        cv2.warpAffine(tinted, warp, tile, flags=cv2.INTER_LINEAR, borderValue=(48, 42, 38)),
        np.uint8,
    )
    index = int(np.flatnonzero(check.moments == moment)[0])
    time_s = check.times_s[index]
    camera = check.rig[name]
    zoom = np.array(checked.mask.shape[::-1]) / camera.size
    for other, track in check.tracks.items():
        if other == name:
            continue
        disagrees = other in check.agreement.culprits and name not in check.agreement.culprits
        for line in touching_lines(camera, track, time_s):
            pixels = (((line + 0.5) * zoom - 0.5) @ warp[:, :2].T) + warp[:, 2]
            wrong = disagrees or name in check.agreement.culprits
            stroke(image, pixels, WARNING if wrong else LEFT)
    return image


def touching_lines(camera: Camera, other: OutlineTrack, time_s: float) -> list[NDArray[np.float64]]:
    """Images (N, 2), px, in a camera of the planes that are tangent to the body in another one."""
    baseline = other.camera.center_m - camera.center_m
    baseline = baseline / max(float(np.linalg.norm(baseline)), 1e-9)
    zero = other.toward_body()
    first = zero - (zero @ baseline) * baseline
    first /= max(float(np.linalg.norm(first)), 1e-9)
    second = np.cross(baseline, first)
    angles, _ = other.tangent_angles(baseline, zero)
    index = int(np.abs(other.time_s - time_s).argmin())
    lines = []
    for angle in angles[index][np.isfinite(angles[index])]:
        normal_ray = np.cos(angle) * first + np.sin(angle) * second
        along = np.tan(np.linspace(-1.5, 1.5, 400))
        pixels, _ = camera.project(camera.center_m + normal_ray + along[:, None] * baseline)
        lines.append(pixels)
    return lines
