"""Silhouettes cut anew where bodies were found.

Pose and silhouette are estimated in turn. What a body covers was no empty scene, the colours
there are the person's, and in each frame it speaks for the pixels inside of its outline; outside of
all, they speak against them. They say less than a pixel that is sure of itself: a wrong pose does
not make itself right. After PoseCut (Bray, Kohli and Torr, ECCV 2006).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.image.cut import body_odds
from silhouette_core.image.raster import render_parts
from silhouette_core.image.silhouettes import as_recorded
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.tuning import BODY_EVIDENCE

Body = tuple[BodyModel, Sequence[Pose | None]]
"""A body and its poses in all frames; None: it was not found."""


@dataclass(frozen=True, eq=False)
class BodyEvidence:
    """What bodies say of the pixels of a recording's frames.

    Attributes:
        bodies: everybody's, posed in the frame of `views`.
        views: the C pinhole cameras.
        recorded: the cameras as they filmed.
        late: (C,) number of frames by which a camera's pictures come later than the others'.
    """

    bodies: Sequence[Body]
    views: Rig
    recorded: Rig
    late: Sequence[int]

    def __call__(self, name: str, step: int, size: tuple[int, int]) -> NDArray[np.float32]:
        """Odds of people (h, w), nats, of a camera's frame in a size (w, h): of each pixel those of
        the body that says most; somebody who was not found may be anywhere.
        """
        drawn = self._drawn(name, step, size)
        odds = [
            np.zeros(size[::-1], np.float32)
            if body is None
            else body_odds(*body, BODY_EVIDENCE.most)
            for body in drawn
        ]
        if not any(drawn):
            return odds[0]
        return as_recorded(np.maximum.reduce(odds), self.recorded[name])

    def silhouette(self, name: str, step: int, size: tuple[int, int]) -> NDArray[np.bool_]:
        """The bodies (h, w) bool in a camera's frame, as recorded, in a size (w, h)."""
        found = [body[0] for body in self._drawn(name, step, size) if body is not None]
        if not found:
            return np.zeros(size[::-1], np.bool_)
        union = np.logical_or.reduce(found).astype(np.float32)
        return as_recorded(union, self.recorded[name]) > 0.5

    def _drawn(
        self, name: str, step: int, size: tuple[int, int]
    ) -> list[tuple[NDArray[np.bool_], float] | None]:
        """Each body (h, w) bool in a pinhole's frame, and how far, px, from its outline it says the
        most; None where it was not found.
        """
        c = self.views.names.index(name)
        t, camera = step - self.late[c], self.views.cameras[c]
        camera = camera.pinhole(size[0] / camera.size[0])
        drawn: list[tuple[NDArray[np.bool_], float] | None] = []
        for model, poses in self.bodies:
            pose = poses[t] if 0 <= t < len(poses) else None
            if pose is None:
                drawn.append(None)
                continue
            seen = posed_mesh(model, pose) @ camera.rotation.T + camera.translation
            parts, _ = render_parts(seen, model.faces, model.face_part, camera.matrix, size)
            depth_m = max(float(np.median(seen[:, 2])), 0.3)
            reach_px = max(BODY_EVIDENCE.reach_m * camera.matrix[0, 0] / depth_m, 1.0)
            drawn.append((parts > 0, reach_px))
        return drawn


@contextmanager
def cut_by_bodies(
    prepared: PreparedSilhouettes,
    bodies: Sequence[Body],
    clock: StageClock,
    reporter: Reporter,
) -> Iterator[PreparedSilhouettes]:
    """Silhouettes cut anew where bodies were found, for a `with` block.

    Args:
        prepared: the silhouettes by which they were found.
        bodies: posed in the upright frame.
        clock: told the durations.
        reporter: told the progress.
    """
    footage, views = prepared.footage, prepared.observer.views
    evidence = BodyEvidence(bodies, views.rig, footage.source.rig, footage.late)
    count = len(prepared.store)
    reporter.stage("silhouettes by the body", count)
    with closing(MaskStore([camera.size for camera in views.rig], count)) as store:
        with clock("silhouettes"):
            silhouettes = footage.silhouettes(evidence)
        for t, (_, _, frames) in enumerate(footage.source):
            with clock("silhouettes"):
                found = silhouettes.of(frames, step=t)
                pairs = zip(views.rig.names, footage.lenses, strict=True)
                store.put(t, views.without_unknown([lens.undistort(found[k]) for k, lens in pairs]))
            reporter.advance()
        store.advance(footage.late)
        yield replace(prepared, store=store)
