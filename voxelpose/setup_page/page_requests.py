"""What the page may send: every number bounded, every text short, nothing else let through."""

from typing import Annotated

import msgspec
from msgspec import UNSET, Meta, Struct, UnsetType

from silhouette_core.estimator import BackgroundKind
from voxelpose.view.serving.page_answers import Corner, Moment, Name
from voxelpose.view.viewer.previews import StageAsked

LARGEST_BODY = 4_000_000
"""Bytes of a request: ten thousands of corners."""
MOST_POINTS = 2000

Metre = Annotated[float, Meta(ge=-10_000, le=10_000)]
Polygon = Annotated[list[Corner], Meta(min_length=3, max_length=1000)]
Polygons = Annotated[list[Polygon], Meta(max_length=200)]
# Of a point, as a line of a table: no line breaks, no quotes, nothing before or after.
PointName = Annotated[
    str,
    Meta(
        min_length=1,
        max_length=60,
        pattern=r"^[^\s\x00-\x1f\x7f\",]"
        r"([^\x00-\x1f\x7f\",]*[^\s\x00-\x1f\x7f\",])?$",
    ),
]


class RegionDrawing(Struct, forbid_unknown_fields=True):
    """Where the person may be in one camera."""

    painted: bool  # whether what the file holds beside polygons is kept
    polygons: Polygons  # in px, inside which the person may be


class PlacesDrawn(Struct, forbid_unknown_fields=True):
    """Regions and unknown polygons, px, by camera name; cameras not named stay as in the files."""

    regions: dict[Name, RegionDrawing] = {}
    unknown: dict[Name, Polygons] = {}


class PointClicked(Struct, forbid_unknown_fields=True):
    """A point of the scene."""

    name: PointName
    pixels: dict[Name, Corner] = {}  # px, by camera name, where it was clicked
    # World coordinates in metres, where measured.
    position_m: tuple[Metre, Metre, Metre] | None = None


Points = Annotated[list[PointClicked], Meta(max_length=MOST_POINTS)]
Up = Annotated[str, Meta(min_length=1, max_length=80)]
Typed = dict[Name, bool | int | float | Annotated[str, Meta(max_length=1000)] | None]
"""Settings as they are typed in, by their names; None: the usual value."""


class SilhouetteRequest(Struct, forbid_unknown_fields=True):
    """Silhouettes of a moment, from 0, with what is drawn but not saved."""

    moment: Moment
    background: BackgroundKind = "auto"
    places: PlacesDrawn = msgspec.field(default_factory=PlacesDrawn)


class StageRequest(StageAsked, forbid_unknown_fields=True, kw_only=True):
    """A stage of a camera's silhouette, or a pixel of it, with what is drawn but not saved."""

    background: BackgroundKind = "auto"
    places: PlacesDrawn = msgspec.field(default_factory=PlacesDrawn)


class SaveRequest(Struct, forbid_unknown_fields=True):
    """What is to be written; what is absent stays as it is."""

    places: PlacesDrawn = msgspec.field(default_factory=PlacesDrawn)
    points: Points | UnsetType = UNSET
    fit: Typed = {}  # settings of `fit`; what is absent stays
    # What the page was shown, see `SetupSession.state`; "": whatever another one has saved since.
    seen: Annotated[str, Meta(max_length=64)] = ""
