"""Colours and texts of the viewer."""

import html
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from voxelpose.multiview.matching.matcher import LimbArea
from voxelpose.people_marks import COLOURS, person_names
from voxelpose.view.images.canvas import Colour

# RGB, vermilion over yellow to blue: no kind of colour vision confuses the ends.
_RAMP = np.array([[213, 62, 20], [244, 190, 60], [64, 132, 214]])
UNKNOWN: Colour = (150, 150, 150)
HULL: Colour = (140, 150, 160)
UNEXPLAINED: Colour = (214, 40, 150)
AREA: Colour = (120, 196, 190)
DISPUTED: Colour = (122, 62, 178)
HYPOTHESIS: Colour = (60, 60, 60)
PAPER: Colour = (255, 255, 255)
SILHOUETTE: Colour = (255, 150, 40)
OUTLYING_CM = 5
"""Distance from the body above which a voxel is unexplained: a hull of few cameras is too large."""
FAR = f"more than {OUTLYING_CM} cm from the body"


def overlap_colours(overlap: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours (n, 3) uint8 RGB of fractions (n,) of parts inside the hull; grey where NaN."""
    position = np.clip(np.nan_to_num(overlap), 0, 1) * (len(_RAMP) - 1)
    low = np.minimum(position.astype(int), len(_RAMP) - 2)
    mixed = _RAMP[low] + (position - low)[:, None] * (_RAMP[low + 1] - _RAMP[low])
    return np.where(np.isfinite(overlap)[:, None], mixed, UNKNOWN).round().astype(np.uint8)


def faded(likelihood: float) -> NDArray[np.uint8]:
    """Colour (3,) RGB of a hypothesis by its relative likelihood: the less likely fade."""
    opacity = 0.15 + 0.85 * min(likelihood, 1.0)
    mixed = opacity * np.array(HYPOTHESIS) + (1 - opacity) * np.array(PAPER)
    return mixed.round().astype(np.uint8)


def display_name(part: str) -> str:
    """Name of a part with spaces."""
    return part.replace("_", " ")


def person_colour(number: int) -> Colour:
    """Colour, RGB, of one of several people, counted from 0."""
    return COLOURS[number % len(COLOURS)]


def legend_html(with_hypotheses: bool, people: int = 1) -> str:
    """Legend of the colours, as HTML; several people have one each, and parts none."""
    ramp = ", ".join(css_colour(colour) for colour in overlap_colours(np.linspace(0, 1, 7)))
    rows = [
        (HULL, "carved voxels: where all silhouettes allow a body"),
        (UNEXPLAINED, f"voxels that no part explains, {FAR}"),
    ]
    if people > 1:
        names = map(display_name, person_names(people))
        rows += [(person_colour(k), name) for k, name in enumerate(names)]
    else:
        rows += [
            (AREA, "where the chosen part could be (its movable area)"),
            (DISPUTED, "where another part could be, too: they are matched together"),
            (UNKNOWN, "part too small to be measured"),
        ]
    if with_hypotheses:
        words = "other poses that the camera leaves open; the fainter, the less likely"
        rows.append((HYPOTHESIS, words))
    swatch = (
        '<span style="display:inline-block;width:0.8em;height:0.8em;border-radius:0.2em;'
        'background:{};margin-right:0.5em"></span>'
    )
    lines = "".join(
        f"<div>{swatch.format(css_colour(colour))}{words}</div>" for colour, words in rows
    )
    bar = (
        '<div style="height:0.8em;border-radius:0.2em;background:linear-gradient(90deg,'
        f' {ramp})"></div>'
    )
    ends = (
        '<div style="display:flex;justify-content:space-between">'
        "<span>0 %</span><span>50</span><span>100 %</span></div>"
    )
    parts = "" if people > 1 else f"<b>Part inside the hull</b>{bar}{ends}"
    style = "padding:0 0.8em 0.6em;font-size:0.8em;line-height:1.6"
    return f'<div style="{style}">{parts}{lines}</div>'


def text_html(lines: Sequence[str]) -> str:
    """Lines of plain text as HTML, the first one as a title."""
    title, *rest = map(html.escape, lines)
    paragraphs = "".join(f'<div style="margin-top:0.6em">{line}</div>' for line in rest)
    return (
        f'<div style="padding:0.4em 0.8em 0.6em;line-height:1.5"><b>{title}</b>{paragraphs}</div>'
    )


def area_text(part: str | None, areas: dict[str, LimbArea]) -> str:
    """Description of the chosen part's movable area, as Markdown."""
    if part is None:
        return (
            "Choose a part to see where it could be, and with which others it is matched together."
        )
    if part not in areas:
        return "There is no pose or no hull in this frame."
    area = areas[part]
    others = [display_name(name) for name in area.interferes if name != part]
    reach = f"The {display_name(part)} could be in {len(area.voxels)} voxels"
    if not others:
        return f"{reach}; no other part claims any of them."
    disputed = 100 * len(area.disputed) / max(len(area.voxels), 1)
    return (
        f"{reach}, {disputed:.0f} % of them disputed. Matched with, directly or through others:"
        f" {', '.join(others)}."
    )


def css_colour(colour: Colour | NDArray[np.uint8]) -> str:
    """A colour, RGB, as pages write it."""
    return "#{:02x}{:02x}{:02x}".format(*(int(v) for v in colour))
