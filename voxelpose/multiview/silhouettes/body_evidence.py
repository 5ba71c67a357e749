"""Silhouettes cut anew where the body was found.

Pose and silhouette are estimated in turn. What the body covers was no empty scene, the colours
there are the person's, and in each frame it speaks for the pixels inside of its outline and against
those outside. It says less than a pixel that is sure of itself: a wrong pose does not make itself
right. After PoseCut (Bray, Kohli and Torr, ECCV 2006).
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


@dataclass(frozen=True, eq=False)
class BodyEvidence:
    """What a body says of the pixels of a recording's frames.

    Attributes:
        model: the body.
        poses: of T frames, in the frame of `views`; None: not found.
        views: the C pinhole cameras.
        recorded: the cameras as they filmed.
        late: (C,) number of frames by which a camera's pictures come later than the others'.
    """

    model: BodyModel
    poses: Sequence[Pose | None]
    views: Rig
    recorded: Rig
    late: Sequence[int]

    def __call__(self, name: str, step: int, size: tuple[int, int]) -> NDArray[np.float32]:
        """Odds of the person (h, w), nats, of a camera's frame in a size (w, h)."""
        drawn = self._drawn(name, step, size)
        if drawn is None:
            return np.zeros(size[::-1], np.float32)
        return as_recorded(body_odds(*drawn, BODY_EVIDENCE.most), self.recorded[name])

    def silhouette(self, name: str, step: int, size: tuple[int, int]) -> NDArray[np.bool_]:
        """The body (h, w) bool in a camera's frame, as recorded, in a size (w, h)."""
        drawn = self._drawn(name, step, size)
        if drawn is None:
            return np.zeros(size[::-1], np.bool_)
        return as_recorded(drawn[0].astype(np.float32), self.recorded[name]) > 0.5

    def _drawn(
        self, name: str, step: int, size: tuple[int, int]
    ) -> tuple[NDArray[np.bool_], float] | None:
        """The body (h, w) bool in a pinhole's frame, and how far, px, from its outline it says the
        most; None where it was not found.
        """
        c = self.views.names.index(name)
        t = step - self.late[c]
        pose = self.poses[t] if 0 <= t < len(self.poses) else None
        if pose is None:
            return None
        camera, model = self.views.cameras[c], self.model
        camera = camera.pinhole(size[0] / camera.size[0])
        seen = posed_mesh(model, pose) @ camera.rotation.T + camera.translation
        parts, _ = render_parts(seen, model.faces, model.face_part, camera.matrix, size)
        depth_m = max(float(np.median(seen[:, 2])), 0.3)
        return parts > 0, max(BODY_EVIDENCE.reach_m * camera.matrix[0, 0] / depth_m, 1.0)


@contextmanager
def cut_by_body(
    prepared: PreparedSilhouettes,
    model: BodyModel,
    poses: Sequence[Pose | None],
    clock: StageClock,
    reporter: Reporter,
) -> Iterator[PreparedSilhouettes]:
    """Silhouettes cut anew where a body was found, for a `with` block.

    Args:
        prepared: the silhouettes by which it was found.
        model: the body.
        poses: of all frames, in the upright frame; None: not found.
        clock: told the durations.
        reporter: told the progress.
    """
    footage, views = prepared.footage, prepared.observer.views
    evidence = BodyEvidence(model, poses, views.rig, footage.source.rig, footage.late)
    reporter.stage("silhouettes by the body", len(poses))
    with closing(MaskStore([camera.size for camera in views.rig], len(poses))) as store:
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
