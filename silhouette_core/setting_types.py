"""Types of settings with their ranges, as of the command line, of files, of pages and of results,
and the check of a value by its type.
"""

import difflib
import types
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import msgspec
from msgspec import Meta

from calib.errors import InputError

STATURES_M = 50 / 100, 260 / 100  #: Smallest and largest stature of a person.
CHESTS_M = 40 / 100, 180 / 100  #: Smallest and largest chest girth of a person.
VOXELS_M = 5 / 1000, 100 / 1000  #: Smallest and largest edge of a voxel that is matched.
ORDERS = 1, 8  #: Lowest and highest order of a filter.

Stature = Annotated[float, Meta(ge=STATURES_M[0], le=STATURES_M[1], description="metres")]
Chest = Annotated[float, Meta(ge=CHESTS_M[0], le=CHESTS_M[1], description="metres")]
VoxelSize = Annotated[float, Meta(ge=VOXELS_M[0], le=VOXELS_M[1], description="metres")]
Tolerance = Annotated[int, Meta(ge=0, le=100, description="cameras")]
Coordinate = Annotated[float, Meta(ge=-1_000_000, le=1_000_000, description="metres")]
FrameNumber = Annotated[int, Meta(ge=0, le=10_000_000)]
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
Limbs = Literal["arms", "legs"]
SkeletonName = Literal["voxelpose", "mixamo", "rigify", "unreal", "unity", "vrm"]
"""Skeletons of exported files: our own, and those of other programs."""
Start = Literal["facing", "any"]
"""Of the first frame before one camera: the person mostly faces it, or may be turned any way."""
_WORDS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path, as text",
}


def checked(
    given: object, kind: Any, name: str, hook: Callable[[type, Any], Any] | None = None
) -> Any:
    """A value of a type; `hook` makes what JSON has not, see `msgspec.convert`. InputError, which
    begins with the name, where it is none.
    """
    plain = getattr(given, "item", lambda: given)()  # of NumPy's numbers
    try:
        return msgspec.convert(plain, kind, dec_hook=hook)
    except (msgspec.ValidationError, NotImplementedError, OverflowError):
        expected = f"{type_words(kind)}{nearest(str(given), choices_of(kind))}"
        raise InputError(f"{name} = {str(given)[:60]!r} must be {expected}") from None


def unmarked(hint: Any) -> tuple[Any, ...]:
    """A type, and its marks."""
    return (hint.__origin__, *hint.__metadata__) if get_origin(hint) is Annotated else (hint,)


def nearest(word: str, names: Iterable[str]) -> str:
    """`: did you mean NAME?` where a name is like a word, else nothing."""
    close = difflib.get_close_matches(word, list(names), 1)
    return f": did you mean {close[0]}?" if close else ""


def types_if_given(kind: Any) -> tuple[Any, ...]:
    """The types that a value may have, but for None."""
    return tuple(unmarked(part)[0] for part in _parts(kind))


def range_of(kind: Any) -> tuple[float | None, float | None]:
    """Smallest and largest number that a value may be; None where there is no such bound."""
    bounds = _bounds(kind)
    return (None, None) if bounds is None else (bounds.ge, bounds.le)


def _bounds(kind: Any) -> Meta | None:
    marks = [mark for part in _parts(kind) for mark in unmarked(part)[1:]]
    return next((mark for mark in marks if isinstance(mark, Meta) and mark.le is not None), None)


def _parts(kind: Any) -> list[Any]:
    whole = unmarked(kind)[0]
    parts = get_args(whole) if get_origin(whole) in (Union, types.UnionType) else (kind,)
    return [part for part in parts if part is not types.NoneType]


def choices_of(kind: Any) -> tuple[str, ...]:
    """The words of which a value is one; none where it is any."""
    first = types_if_given(kind)[0]
    return get_args(first) if get_origin(first) is Literal else ()


def type_words(kind: Any) -> str:
    """What a value is, in words."""
    bounds = _bounds(kind)
    kind, *others = types_if_given(kind)
    if bounds is not None:
        range_words = f"{_WORDS[kind]} from {bounds.ge:g} to {bounds.le:g}"
        return f"{range_words} {bounds.description or ''}".rstrip()
    if others:
        return ", or ".join(map(type_words, (kind, *others)))
    if choices := choices_of(kind):
        return f"one of {', '.join(choices)}"
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        if others == [...]:
            return f"a list in brackets, of which each is {type_words(first)}"
        return f"a list of {len(others) + 1} numbers in brackets"
    return _WORDS[kind]
