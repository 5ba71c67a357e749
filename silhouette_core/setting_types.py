"""Types of settings and their ranges, as of the command line, of files, of pages and of results."""

from typing import Annotated, Literal

from msgspec import Meta

STATURES_M = 50 / 100, 260 / 100  #: Smallest and largest stature of a person.
CHESTS_M = 40 / 100, 180 / 100  #: Smallest and largest chest girth of a person.
VOXELS_M = 5 / 1000, 100 / 1000  #: Smallest and largest edge of a voxel that is matched.
ORDERS = 1, 8  #: Lowest and highest order of a filter.

Stature = Annotated[float, Meta(ge=STATURES_M[0], le=STATURES_M[1])]
Chest = Annotated[float, Meta(ge=CHESTS_M[0], le=CHESTS_M[1])]
VoxelSize = Annotated[float, Meta(ge=VOXELS_M[0], le=VOXELS_M[1])]
Tolerance = Annotated[int, Meta(ge=0, le=100)]  #: Of cameras.
Threads = Annotated[int, Meta(ge=1, le=100_000)]
Sex = Literal["male", "female", "unknown"]
Repair = Literal["auto", "say", "off"]  #: See `voxelpose.multiview.multiview_estimator`.
FilterKind = Literal["auto", "butterworth", "savgol", "gaussian", "none"]
FilterOrder = Annotated[int, Meta(ge=ORDERS[0], le=ORDERS[1])]
GapMethod = Literal["linear", "pchip", "none"]
NetworkUse = Literal["auto", "off"]  #: Whether the network is used where it is installed.
BackgroundKind = Literal["auto", "uniform", "moving", "paper"]
"""What the background of a camera without an empty view is taken from: a uniform backdrop where one
is recognised (`auto`), one that is known to be uniform (`uniform`), or what shows where the person
is not (`moving`). `paper`: as `auto`, silhouettes as in Okada and Stenger 5.1."""
