"""The person's colours in the pictures of a recording, for what background subtraction misses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import cv2
import numpy as np

from silhouette_core.estimator import FrameSource
from silhouette_core.image.person_colours import ColourDensity, PersonColours
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.progress import Reporter, StageClock
from voxelpose.multiview.silhouettes.mask_store import MaskStore, mask_stores

_LEARNED = 60  # frames from which the colours are learned


class ColourFinder:
    """Finds a person's colours in the pictures of a recording.

    Args:
        source: the frames.
        silhouettes: of the recording.
        lenses: of all cameras.
        late_frames: how many frames later than the others a camera's pictures are, by its name.
        clock: told the durations.
        reporter: told the progress.
    """

    def __init__(
        self,
        source: FrameSource,
        silhouettes: Silhouettes,
        lenses: Sequence[UndistortedView],
        late_frames: Mapping[str, int],
        clock: StageClock,
        reporter: Reporter,
    ):
        """Keeps what it is given."""
        self._source, self._silhouettes, self._lenses = source, silhouettes, lenses
        self._late = [late_frames.get(name, 0) for name in source.rig.names]
        self._clock, self._reporter = clock, reporter

    @property
    def useful(self) -> bool:
        """Whether colours tell anything."""
        return self._silhouettes.colours_tell

    def learn(self, store: MaskStore) -> ColourDensity | None:
        """Density of the colours within silhouettes; None where there are none."""
        colours, last, names = PersonColours(), len(store) - 1, self._source.rig.names
        self._reporter.stage("colours", len(store))
        for t, (_, _, frames) in enumerate(self._source):
            self._reporter.advance()
            if t % (last // _LEARNED + 1):
                continue
            with self._clock("colours"):
                for c, (name, lens) in enumerate(zip(names, self._lenses, strict=True)):
                    # The silhouettes were put in step, the pictures were not.
                    mask = store[min(max(t - self._late[c], 0), last)][c]
                    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
                    if width:
                        picture = lens.undistort_part(frames[name], (left, top), (width, height))
                        colours.add(picture, mask[top : top + height, left : left + width])
        return colours.density()

    @contextmanager
    def find(self, density: ColourDensity) -> Iterator[list[MaskStore]]:
        """Stores of `ColouredSilhouette.likely` and `alike` of all frames, for a `with` block."""
        sizes, names = [lens.pinhole.size for lens in self._lenses], self._source.rig.names
        with mask_stores(2, sizes, self._source.frame_count) as stores:
            self._reporter.stage("silhouettes by colours", self._source.frame_count)
            for t, (_, _, frames) in enumerate(self._source):
                with self._clock("colours"):
                    found = self._silhouettes.of_colours(frames, density)
                    for store, kind in zip(stores, ("likely", "alike"), strict=True):
                        masks = (getattr(found[name], kind) for name in names)
                        pairs = zip(self._lenses, masks, strict=True)
                        store.put(t, [lens.undistort(mask) for lens, mask in pairs])
                self._reporter.advance()
            for store in stores:
                store.advance(self._late)
            yield stores
