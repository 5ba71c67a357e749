"""Whether silhouettes can be those of a person at all."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from calib.checks import BoolArray
from calib.components import label_components
from calib.errors import InputError
from calib.moments import even_moments
from silhouette_core.image.cleanup import opened
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.tuning import PLAUSIBILITY

_MOMENTS = 8
_LEAST_MOMENTS = 3  # from which changes tell
_JUMP = np.log(2)  # of the area, between neighbouring frames: doubled. People's change by 0.06.
_SEEN_IN_SETUP = "look at them with `voxelpose setup`"


class ImplausibleSilhouettesError(InputError):
    """Silhouettes that cannot be those of a person.

    Attributes:
        masks: (h, w) bool of the `telling_frames`, by the name of each camera at fault.
        faults: what is wrong with them, likewise.
        lenses: by which they are undistorted, likewise; without one they are as recorded.
    """

    def __init__(
        self,
        masks: Mapping[str, Sequence[BoolArray]],
        faults: Mapping[str, str],
        lenses: Mapping[str, UndistortedView],
        given: bool = False,
    ) -> None:
        """Keeps all of it; `given`: whether masks were, of which no background is to blame."""
        self.masks, self.faults, self.lenses, self._given = masks, faults, lenses, given
        super().__init__(self._line(_SEEN_IN_SETUP))

    def shown_in(self, picture: Path) -> InputError:
        """The same error, which names a picture of the silhouettes."""
        return InputError(self._line(f"see {picture}, and why with `voxelpose setup`"))

    def _line(self, where: str) -> str:
        listed = "; ".join(f"those of {name} {fault}" for name, fault in self.faults.items())
        remedy = "draw regions/CAMERA.png, or mend the masks"
        if not self._given:
            remedy = f"record the empty view as background, {remedy}"
        return f"the silhouettes cannot be those of a person: {listed}: {where}; {remedy}"


def telling_frames(count: int) -> list[int]:
    """Frames of a recording of `count` that tell it: some moments, each with the frame after it."""
    moments = even_moments(count, _MOMENTS).tolist()
    return [min(t + later, count - 1) for t in moments for later in (0, 1)]


def check_plausible(
    masks: Mapping[str, Sequence[BoolArray]],
    least: int,
    *,
    person: bool = True,
    lenses: Mapping[str, UndistortedView] | None = None,
    given: bool = False,
) -> None:
    """Checks that enough cameras have silhouettes that can be those of a person. Raises
    ImplausibleSilhouettesError where fewer do: the others' cover nearly the whole picture, are
    noise, are straight like a wall, or jump.

    Args:
        masks: silhouettes (H, W) bool of the `telling_frames`, by camera name.
        least: number of cameras that must have them.
        person: whether it is a person; of other bodies shape and changes are not checked.
        lenses: by which they are undistorted, by camera name; None: they are as recorded.
        given: whether they were given as masks.
    """
    checked = {name: _fault(camera_masks, person) for name, camera_masks in masks.items()}
    faults = {name: fault for name, fault in checked.items() if fault}
    if len(masks) - len(faults) < least and faults:
        refused = {name: masks[name] for name in faults}
        raise ImplausibleSilhouettesError(refused, faults, lenses or {}, given)


def _fault(masks: Sequence[BoolArray], person: bool) -> str:
    shares = [float(mask.mean()) for mask in masks]
    share = float(np.median(shares))
    if share > PLAUSIBILITY.covered:
        return f"cover {100 * share:.0f} % of the picture"
    seen = [mask for mask in masks if mask.any()]
    if seen and np.median([_solid(mask) for mask in seen]) < PLAUSIBILITY.solid:
        return "are specks all over the picture"
    if not seen or not person:
        return ""
    shapes = [_shape(mask) for mask in seen]
    if np.median([filled for filled, _ in shapes]) > PLAUSIBILITY.rectangle:
        return "fill a rectangle"
    moments = masks[::2]
    if len(moments) < _LEAST_MOMENTS:
        return ""
    changed = [(a ^ b).sum() / max((a | b).sum(), 1) for a, b in pairwise(moments)]
    spans = np.mean([spanning for _, spanning in shapes]) > 0.5
    if spans and np.median(changed) < PLAUSIBILITY.changed:
        return "go from border to border and never change"
    areas = np.array([(a.sum(), b.sum()) for a, b in zip(moments, masks[1::2], strict=False)])
    jumps = np.abs(np.diff(np.log(areas[areas.any(axis=1)] + 1.0), axis=1))
    return "jump in size from frame to frame" if np.median(jumps) > _JUMP else ""


def _shape(mask: BoolArray) -> tuple[float, bool]:
    """What the largest piece fills of its upright rectangle, and whether that goes from one border
    of the picture to the opposite one.
    """
    pieces = label_components(mask)
    largest = int(pieces.sizes[1:].argmax())
    low, high = pieces.bounds[largest]
    spans = bool(((low == 0) & (high == mask.shape)).any())
    return float(pieces.sizes[1 + largest] / (high - low).prod()), spans


def _solid(mask: BoolArray) -> float:
    """Fraction of the foreground that an opening by three by three pixels leaves."""
    return float(opened(mask, 3).sum() / mask.sum())
