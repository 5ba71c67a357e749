"""The two estimators in live use: silhouettes of a moment in, a posed body out."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings, read_options
from silhouette_core.filter.forward import FilterFrame
from silhouette_core.filter.monocular_stages import (
    LONG_SIDE_PX,
    MonocularOptions,
    MonocularStages,
    library_for,
)
from silhouette_core.image.raster import render_parts
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.jit import set_threads
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.progress import Reporter, StageClock
from voxelpose.carving.carver import carve
from voxelpose.carving.grid import VoxelGrid
from voxelpose.live.live_frame import PosedBody
from voxelpose.live.shots import Shot
from voxelpose.matching.body_track import Moment
from voxelpose.matching.follower import PoseFollower
from voxelpose.matching.observe import body_rule
from voxelpose.matching.track_jobs import FollowSettings, adapt_body, search, search_limbs

Masks = Mapping[str, NDArray[np.bool_]]

_HULL_EVERY = 5  # frames between two hulls, which are only shown
_HULL_VOXEL_M, _HULL_REACH_M = 0.05, 1.2
_HYPOTHESES = 5
_USUAL_STATURE_M = 1.70  # of the body with which kernels are loaded
_OCCLUDED = 0.3  # confidence of a joint on a part that is occluded, relative to the pose's


class LiveEstimator(Protocol):
    """Estimates the person of every moment; its two stages run in a thread each."""

    rig: Rig

    def observe(self, shot: Shot, masks: Masks) -> object:
        """What the estimation needs of a moment with its silhouettes, as recorded."""
        ...

    def estimate(self, observed: object) -> PosedBody | None:
        """The person in what was observed; None where there is none."""
        ...

    def close(self) -> None:
        """Ends the estimator's own threads."""
        ...


def _begin_process() -> None:
    """Keeps a process to one core, leaves interrupts to the one that began it, and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_threads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Ends this process once the one that began it is gone, even if that was killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _load_kernels(rig: Rig, settings: FollowSettings, moment: Moment) -> None:
    """Runs once all that is done to follow a body."""
    track = search(rig, settings, None, moment, 1)
    if track is not None:
        track = track.step(rig, moment.time_s + 0.03, moment.masks())
        search_limbs(rig, track, moment)
        adapt_body(rig, settings, track, [(moment, track.fit.pose)])


def _drawn(rig: Rig, body: BodyModel) -> dict[str, NDArray[np.bool_]]:
    """Silhouettes (h, w) bool of an upright body at the point nearest to all optical axes."""
    axes = np.stack([camera.rotation[2] for camera in rig])
    away = np.eye(3) - axes[:, :, None] * axes[:, None]
    centers = np.stack([camera.center_m for camera in rig])
    middle = np.linalg.lstsq(away.sum(0), np.einsum("cij,cj->i", away, centers), rcond=None)[0]
    vertices = body.vertices_m + middle - body.joints_m[0]
    masks = {}
    for camera in rig:
        inside = vertices @ camera.rotation.T + camera.translation
        parts, _ = render_parts(inside, body.faces, body.face_part, camera.matrix, camera.size)
        masks[camera.name] = parts > 0
    return masks


@dataclass(frozen=True, eq=False)
class _Silhouetted:
    """Silhouettes (h, w) bool of a moment in pinhole cameras."""

    time_s: float
    masks: Masks


class LiveMultiView:
    """Several cameras: see `PoseFollower`.

    Args:
        rig: the cameras, as they take their pictures.
        settings: what is known about the person.
    """

    def __init__(self, rig: Rig, settings: FollowSettings):
        """Starts without a person."""
        self.rig = rig
        self._lenses = {c.name: UndistortedView.from_camera(c, LONG_SIDE_PX) for c in rig}
        self._pinholes = Rig(tuple(lens.pinhole for lens in self._lenses.values()))
        # A process of its own: as a thread it would take the interpreter from the frames' stages.
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), _begin_process)
        self._follower = PoseFollower(self._pinholes, settings, self._pool)
        self._frame = 0
        self._hull: NDArray[np.float32] | None = None
        self._warm_up(settings)

    def observe(self, shot: Shot, masks: Masks) -> _Silhouetted:
        """See `LiveEstimator.observe`."""
        pinhole = {name: self._lenses[name].undistort(mask) for name, mask in masks.items()}
        return _Silhouetted(shot.time_s, pinhole)

    def estimate(self, observed: object) -> PosedBody | None:
        """See `LiveEstimator.estimate`."""
        seen = cast(_Silhouetted, observed)
        fit, body = self._follower.step(seen.time_s, seen.masks), self._follower.body
        if fit is None or body is None:
            self._hull = None
            return None
        if self._frame % _HULL_EVERY == 0:
            self._hull = self._carved(seen.masks, fit.pose)
        self._frame += 1
        confidence = float(np.clip(1 - fit.error, 0, 1))
        return posed_body(body.model, fit.pose, confidence, np.ones(15), hull_m=self._hull)

    def close(self) -> None:
        """See `LiveEstimator.close`."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _warm_up(self, settings: FollowSettings) -> None:
        """Follows a drawn body for a moment, so that all kernels are loaded before the first frame
        is: that takes seconds.
        """
        body = BodyModel.from_sizes(BodySizes(settings.stature_m or _USUAL_STATURE_M))
        silhouettes = _drawn(self._pinholes, body)
        if sum(mask.any() for mask in silhouettes.values()) < 2:
            return
        moment = Moment.of(0.0, silhouettes)
        beside = self._pool.submit(_load_kernels, self._pinholes, settings, moment)
        _load_kernels(self._pinholes, settings, moment)
        beside.result()

    def _carved(self, masks: Masks, pose: Pose) -> NDArray[np.float32]:
        low, high = pose.root_m - _HULL_REACH_M, pose.root_m + _HULL_REACH_M
        grid = VoxelGrid.from_bounds(low, high, _HULL_VOXEL_M)
        rig = self._pinholes.select(list(masks))
        hull = carve(rig, dict(masks), grid, body_rule(len(masks), 0))
        return grid.occupied_points(hull).astype(np.float32)


class _Untimed(StageClock):
    """Keeps no durations: a session may last for days."""

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        yield


class LiveMonocular:
    """One camera: see `MonocularStages`.

    Args:
        rig: the camera, as it takes its pictures.
        settings: what is known about the person, and the options of the estimator.
        fps: rate of the camera.
        pictures: whether the pictures have colours, or are silhouettes.
        reporter: told about the library.
    """

    def __init__(
        self, rig: Rig, settings: Settings, fps: float, pictures: bool, reporter: Reporter
    ):
        """Reads or makes the library, which may take minutes at the first use."""
        self.rig = rig
        options = read_options(MonocularOptions, settings.options, "monocular")
        library = library_for(options, settings, reporter)
        reporter.stage("motion model")
        self._stages = MonocularStages(
            library, rig.cameras[0], settings, options, 1 / fps, pictures, _Untimed()
        )

    def observe(self, shot: Shot, masks: Masks) -> FilterFrame | None:
        """See `LiveEstimator.observe`."""
        name = self.rig.names[0]
        person = self._stages.person(shot.pictures[name], masks[name])
        if person is None:
            return None
        return self._stages.posterior(shot.number, shot.time_s, person)

    def estimate(self, observed: object) -> PosedBody | None:
        """See `LiveEstimator.estimate`."""
        if observed is None:
            return None
        (found,) = self._stages.estimates(cast(FilterFrame, observed))
        model, confidence = self._stages.trajectory.model, float(np.clip(1 - found.error, 0, 1))
        shown = np.where(found.occluded[model.landmark_part], _OCCLUDED, 1.0)
        hypotheses = tuple(
            (float(probability), joints)
            for probability, joints in zip(
                found.probability[:_HYPOTHESES], found.joints[:_HYPOTHESES], strict=True
            )
        )
        return posed_body(model, found.pose, confidence, shown, hypotheses)

    def close(self) -> None:
        """See `LiveEstimator.close`."""


def posed_body(
    model: BodyModel,
    pose: Pose,
    confidence: float,
    shown: NDArray[np.float64],
    hypotheses: tuple[tuple[float, NDArray[np.float64]], ...] = (),
    hull_m: NDArray[np.float32] | None = None,
) -> PosedBody:
    """Body with its parts and joints in the world.

    Args:
        model: the body.
        pose: its pose.
        confidence: of the pose, from 0 to 1.
        shown: (15,) confidence of each joint, relative to the pose's.
        hypotheses: as of `PosedBody`.
        hull_m: as of `PosedBody`.
    """
    rotation, origin = place(model, *PoseArrays.from_poses([pose]).arrays)
    joints = landmarks(model, rotation, origin)[0]
    return PosedBody(
        model,
        pose,
        rotation[0],
        origin[0],
        joints,
        confidence * shown,
        confidence,
        hypotheses,
        hull_m,
    )
