"""What colours mean in the viewer, and what it says about a frame. Plain text and numbers: nothing
is drawn here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import PART_NAMES
from voxelpose.view.viewer.result_scenes import Area, Scene

Colour = tuple[int, int, int]

# RGB. From vermilion over yellow to blue: no kind of colour vision confuses the ends.
_RAMP = np.array([[213, 62, 20], [244, 190, 60], [64, 132, 214]], float)
UNKNOWN: Colour = (150, 150, 150)
HULL: Colour = (140, 150, 160)
UNEXPLAINED: Colour = (214, 40, 150)
AREA: Colour = (120, 196, 190)
DISPUTED: Colour = (122, 62, 178)
GUESS: Colour = (60, 60, 60)
PAPER: Colour = (255, 255, 255)
SILHOUETTE: Colour = (255, 150, 40)
# a hull of few cameras is larger than the body in it; farther away a voxel means something
OFF_M = 0.05
_WEAK = 0.5


def overlap_colours(share: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Returns the colours (n, 3) uint8 RGB of parts' shares (n,) inside the hull; grey where NaN."""
    place = np.clip(np.nan_to_num(share), 0, 1) * (len(_RAMP) - 1)
    low = np.minimum(place.astype(int), len(_RAMP) - 2)
    mixed = _RAMP[low] + (place - low)[:, None] * (_RAMP[low + 1] - _RAMP[low])
    return np.where(np.isfinite(share)[:, None], mixed, UNKNOWN).round().astype(np.uint8)


def spoken(name: str) -> str:
    """Returns a part's name as people say it."""
    return name.replace("_", " ")


def legend_html(with_hypotheses: bool) -> str:
    """Returns the legend."""
    ramp = ", ".join(_css(colour) for colour in overlap_colours(np.linspace(0, 1, 7)))
    rows = [
        (HULL, "carved voxels: where all silhouettes allow a body"),
        (
            UNEXPLAINED,
            f"voxels that no part explains, more than {100 * OFF_M:.0f} cm from the body",
        ),
        (AREA, "where the chosen part could be (its movable area)"),
        (DISPUTED, "there another part could be, too: they are matched together"),
        (UNKNOWN, "part too small to be measured"),
        *(
            [(GUESS, "other poses that the camera leaves open; the fainter, the less likely")]
            if with_hypotheses
            else []
        ),
    ]
    swatch = (
        "<span"
        ' style="display:inline-block;width:0.8em;height:0.8em;border-radius:0.2em;background:{};margin-right:0.5em"></span>'
    )
    lines = "".join(f"<div>{swatch.format(_css(colour))}{words}</div>" for colour, words in rows)
    bar = (
        '<div style="height:0.8em;border-radius:0.2em;background:linear-gradient(90deg,'
        f' {ramp})"></div>'
    )
    ends = (
        '<div style="display:flex;justify-content:space-between"><span>0'
        " %</span><span>50</span><span>100 %</span></div>"
    )
    return (
        '<div style="padding:0 0.8em 0.6em;font-size:0.8em;line-height:1.6"><b>Part inside the'
        f" hull</b>{bar}{ends}{lines}</div>"
    )


def frame_words(scene: Scene) -> str:
    """Returns what there is to say about a frame, as Markdown."""
    lines = [f"**Frame {scene.frame}**, {scene.time_s:.2f} s"]
    if scene.body is not None:
        if scene.body.confidence is not None and np.isfinite(scene.body.confidence):
            lines.append(
                f"Confidence {100 * scene.body.confidence:.0f} %: how well the body's outline"
                " covers the silhouettes."
            )
        weak = [
            spoken(name)
            for name, share in zip(PART_NAMES, scene.body.overlap, strict=True)
            if share < _WEAK
        ]
        if weak:
            lines.append(f"Little inside the hull: {', '.join(weak)}.")
    if scene.hull is not None:
        voxel_l = 1000 * scene.hull.grid.voxel_size_m**3
        lines.append(f"Hull {voxel_l * np.count_nonzero(scene.hull.occupancy):.0f} litres.")
        if scene.body is not None:
            far = voxel_l * np.count_nonzero(scene.hull.off_m > OFF_M)
            lines.append(
                f"{far:.0f} litres of it are more than {100 * OFF_M:.0f} cm from the body."
            )
    lines += [f"⚠ {note}" for note in scene.notes]
    lines += [
        f"Pose {hypothesis.rank}: {100 * hypothesis.probability:.0f} %"
        for hypothesis in scene.hypotheses
    ]
    return "\n\n".join(lines)


def area_words(part: str | None, areas: dict[str, Area]) -> str:
    """Returns what there is to say about the chosen part's movable area, as Markdown."""
    if part is None:
        return (
            "Choose a part to see where it could be, and with which others it is matched together."
        )
    if part not in areas:
        return "There is no pose or no hull in this frame."
    area = areas[part]
    others = [spoken(name) for name in area.interferes if name != part]
    if not others:
        return (
            f"The {spoken(part)} could be in {len(area.points_m)} voxels; no other part claims any"
            " of them."
        )
    share = len(area.disputed_m) / max(len(area.points_m), 1)
    where = (
        f"The {spoken(part)} could be in {len(area.points_m)} voxels, {100 * share:.0f} % of them"
        " disputed."
    )
    return f"{where} Matched with, directly or through others: {', '.join(others)}."


def _css(colour: Colour | NDArray[np.uint8]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*(int(v) for v in colour))
