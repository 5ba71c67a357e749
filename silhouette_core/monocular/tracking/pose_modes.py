"""Modes of the learned proposal in the world, frame by frame, and the evidence that they are.

Beyond paper A. The proposal reads 0.8 s of silhouettes about a frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, Float32Array, FloatArray, IndexArray, IntArray, RealArray
from silhouette_core.body.joints import EXCHANGED_LANDMARKS
from silhouette_core.image.seen_joints import SeenJoints
from silhouette_core.monocular.person import upright_distance
from silhouette_core.monocular.proposal.mixture_network import Mixture
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal
from silhouette_core.monocular.proposal.silhouette_features import (
    OFFSETS_S,
    FrameFeatures,
    InsideGrids,
    SilhouetteCodes,
    level_axes,
    mirrored_seen_codes,
    seen_codes,
)
from silhouette_core.monocular.tracking.body_heading import (
    HeadingFilter,
    body_headings,
    smooth_headings,
)
from silhouette_core.monocular.tracking.frame_costs import TrackerSettings
from silhouette_core.monocular.tuning import MODES
from silhouette_core.monocular.window import STATURE_PX, Window, look_at
from silhouette_core.ranking import rounded
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.proposed_poses import ProposedPoses, place_bodies
from silhouette_core.refinement.refine import RefineSettings, RefineStart
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT

_STARTED = 4  # modes of a frame that become hypotheses, at most
_ROUNDS = 3  # in which the distance of a first frame is corrected
MEMORY_S = 2 * float(OFFSETS_S[-1])
"""Time of views by which the newest is understood; the network reads half of it."""
_FROM_MODE = RefineSettings()


@dataclass(frozen=True, eq=False)
class FrameModes(ProposedPoses):
    """M probable poses of one frame."""

    distance_m: float  #: of the pelvis along the optical axis of the window.
    window: Window | None = None  #: Of the silhouette at about that distance, if it was kept.

    def starts(self, surface: Surface, contour: Observation) -> list[RefineStart]:
        """Bodies placed at the most probable modes."""
        expected = self.probable(_STARTED)
        placed = place_bodies(surface, contour, expected)
        return [
            RefineStart(pose, _FROM_MODE, None, prior)
            for pose, prior in zip(placed, expected, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class ModeView:
    """What the proposal reads of one frame."""

    window: Window  #: of the silhouette at an assumed distance.
    codes: SilhouetteCodes  #: of the window's silhouette and of its mirror image.
    time_s: float
    joints: SeenJoints | None = None  #: Of the person, as a pose network sees them, or not.


class ModeFinder:
    """Finds the modes of consecutive frames of one camera.

    Args:
        camera: pinhole camera without distortion.
    """

    def __init__(self, proposal: PoseProposal, camera: Camera, stature_m: float):
        self.proposal, self.camera, self.stature_m = proposal, camera, stature_m
        self._headings = HeadingFilter()

    def window(self, mask: BoolArray, distance_m: float) -> Window:
        """Window of a silhouette (h, w) bool at a distance of the person."""
        return look_at(self.camera, mask, distance_m, STATURE_PX / self.stature_m)

    def first_distance(
        self, mask: BoolArray, time_s: float, joints: SeenJoints | None = None
    ) -> float:
        """Distance of a person who was not seen before: upright, then as the network corrects, m.

        Args:
            mask: (h, w) bool, the silhouette.
            joints: as of `view`.
        """
        distance_m = upright_distance(self.camera, mask, self.stature_m)
        for _ in range(_ROUNDS):
            distance_m = self.distance([self.view(self.window(mask, distance_m), time_s, joints)])
        return distance_m

    def view(self, window: Window, time_s: float, joints: SeenJoints | None = None) -> ModeView:
        """What the proposal reads of a frame, seen through a window about the silhouette, and of
        the joints that a pose network sees.
        """
        # Of the windows only the geometry is kept: their pictures would fill the memory.
        empty = np.zeros((0, 0), bool)
        codes = self.proposal.codes(np.stack([window.mask, window.mask[:, ::-1]]))
        if joints is not None:
            one = self._seen_codes(window, joints)
            codes = replace(codes, joints=np.stack([one, mirrored_seen_codes(one)]))
        return ModeView(replace(window, mask=empty, seen=empty), codes, time_s, joints)

    def _seen_codes(self, window: Window, joints: SeenJoints) -> Float32Array:
        """Codes (45,) of joints in a window, see `seen_codes`."""
        rays = joints.rays @ self.camera.rotation @ window.world_from_virtual
        joints_px = rays[:, :2] / np.maximum(rays[:, 2:], 1e-3)
        return seen_codes(joints_px * window.focal_px / STATURE_PX, joints.visibility)

    def with_inside(self, view: ModeView, inside: InsideGrids | None) -> ModeView:
        """View of a frame with what lies inside the silhouette, grids (60, 80); None: not known."""
        if inside is None:
            return view
        codes = self.proposal.encoding.with_inside(view.codes, inside.with_mirror_image())
        return replace(view, codes=codes)

    def corrected(self, views: Sequence[ModeView], masks: Sequence[BoolArray]) -> list[ModeView]:
        """Views at the distances that the proposal finds itself.

        Args:
            masks: T silhouettes (h, w) bool.
        """
        offset = self._modes(views, _features(views, self.stature_m), False).offset[:, 2]
        distance = np.array([view.window.distance_m for view in views]) * np.exp(offset)
        return [
            self.view(self.window(mask, distance_m), view.time_s, view.joints)
            for mask, distance_m, view in zip(masks, distance, views, strict=True)
        ]

    def distance(self, views: Sequence[ModeView]) -> float:
        """Distance of the pelvis in the last of consecutive frames along its window's axis, m."""
        features = _features(views, self.stature_m)
        offset = self._modes(views, features, True, _last(views)).offset[0, 2]
        return views[-1].window.distance_m * float(np.exp(offset))

    def newest(self, views: Sequence[ModeView], facing: bool = False) -> FrameModes:
        """Modes of the last of consecutive frames, from nothing later: for one frame after another.

        Args:
            views: frames of the last 0.4 s or more.
            facing: whether the person is expected to face the camera in the first frame of all.
        """
        features, last = _features(views, self.stature_m), _last(views)
        modes = self._modes(views, features, True, last)
        joints, axes = self._turned(modes, features.heading_rad[last])
        probability = self._headings.update(
            body_headings(joints)[0],
            np.asarray(modes.probability[0], float),
            views[-1].time_s,
            features.heading_rad[-1] - np.pi / 2 if facing else None,
        )
        return self._in_world(views[-1].window, modes, 0, joints[0], axes[0], probability)

    def find(self, views: Sequence[ModeView], facing: bool = False) -> list[FrameModes]:
        """Modes of consecutive frames, each from all of them.

        Args:
            facing: whether the person is expected to face the camera in the first frame.
        """
        features = _features(views, self.stature_m)
        modes = self._modes(views, features, False)
        joints, axes = self._turned(modes, features.heading_rad)
        probability = smooth_headings(
            body_headings(joints),
            np.asarray(modes.probability, float),
            np.asarray(features.time_s, float),
            first_rad=features.heading_rad[0] - np.pi / 2 if facing else None,
        )
        return [
            self._in_world(view.window, modes, t, joints[t], axes[t], probability[t])
            for t, view in enumerate(views)
        ]

    def _turned(self, modes: Mixture, heading_rad: RealArray) -> tuple[FloatArray, FloatArray]:
        """Joints (T, M, 15, 3) of modes relative to the pelvis, m, in the world, and the axes
        (T, 3, 3) of the level cameras of their frames.
        """
        axes = level_axes(heading_rad)
        return np.einsum("tmli,tij->tmlj", modes.joints * self.stature_m, axes), axes

    def _modes(
        self,
        views: Sequence[ModeView],
        features: FrameFeatures,
        causal: bool,
        frames: IndexArray | None = None,
    ) -> Mixture:
        """Modes of frames and of their mirror images, each half as probable."""
        mirrored = replace(
            features,
            codes=SilhouetteCodes.joined([view.codes[1:] for view in views]),
            heading_rad=np.pi - features.heading_rad,
            anchor=features.anchor * [-1.0, 1.0, 1.0],
        )
        one, other = self.proposal.modes([features, mirrored], causal, frames)
        joints = other.joints[:, :, EXCHANGED_LANDMARKS] * np.array([-1, 1, 1], np.float32)
        offset = other.offset * np.array([-1, 1, 1], np.float32)
        return Mixture(
            0.5 * np.concatenate([one.probability, other.probability], axis=1),
            np.concatenate([one.joints, joints], axis=1),
            np.concatenate([one.sigma, other.sigma[:, :, EXCHANGED_LANDMARKS]], axis=1),
            (0.5 * (one.offset + offset)).astype(np.float32),
            (0.5 * (one.offset_sigma + other.offset_sigma)).astype(np.float32),
        )

    def _in_world(
        self,
        window: Window,
        modes: Mixture,
        t: int,
        joints: FloatArray,
        axes: FloatArray,
        probability: FloatArray,
    ) -> FrameModes:
        """Frame t of the modes; `joints` (M, 15, 3) relative to the pelvis, in the world."""
        joints, probability, nearby = merge_modes(joints, probability)
        depth = window.distance_m * float(np.exp(modes.offset[t, 2]))
        pixel = window.axis_px + modes.offset[t, :2] * STATURE_PX
        pelvis = window.unproject(pixel, depth)[0]
        along = np.outer(axes[1], axes[1])
        sigma = np.einsum("nm,mlk->nlk", nearby, modes.sigma[t].astype(float))
        sigma = np.maximum(sigma * self.stature_m, REFINEMENT.contour_m)
        precision = (
            along / sigma[..., 1, None, None] ** 2
            + (np.eye(3) - along) / sigma[..., 0, None, None] ** 2
        )
        pelvis_precision = np.eye(3) / MODES.pelvis_sigma_m**2
        priors = [
            LandmarkPrior(joints[mode], precision[mode], pelvis, pelvis_precision)
            for mode in range(len(joints))
        ]
        return FrameModes(probability, priors, depth)


def _last(views: Sequence[ModeView]) -> IntArray:
    return np.array([len(views) - 1])


def _features(views: Sequence[ModeView], stature_m: float) -> FrameFeatures:
    windows = [view.window for view in views]
    axes = np.stack([window.world_from_virtual[:, 2] for window in windows])
    anchors = [
        window.center_m + window.distance_m * axis
        for window, axis in zip(windows, axes, strict=True)
    ]
    roots = np.stack(anchors) / stature_m
    middle = float(np.median(roots[:, 2]))
    if not MODES.heights[0] < middle < MODES.heights[1]:
        # The world's z = 0 is not the floor, which the proposal takes for granted.
        roots[:, 2] += MODES.usual_height - middle
    return FrameFeatures(
        SilhouetteCodes.joined([view.codes[:1] for view in views]),
        np.array([window.pitch_rad for window in windows]),
        np.arctan2(axes[:, 1], axes[:, 0]),
        roots,
        np.array([view.time_s for view in views]),
    )


def merge_modes(
    joints: FloatArray, probability: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Modes averaged with those like them: one step of mean shift, and no pose twice.

    Args:
        joints: (M, 15, 3) relative to the pelvis, m.
        probability: (M,).

    Returns:
        Joints (N, 15, 3) of N <= M modes, likeliest first, their probabilities (N,), and the
        weights (N, M) of the averages.

    Source: Comaniciu and Meer, Mean shift (2002).
    """
    apart = np.linalg.norm(joints[:, None] - joints, axis=-1).mean(axis=-1)
    alike_m = TrackerSettings.different_m
    kernel = np.exp(-0.5 * (apart / alike_m) ** 2)
    weights = kernel * probability
    density = weights.sum(axis=1)
    chosen: list[int] = []
    for mode in np.argsort(rounded(-density), kind="stable"):
        if all(apart[mode, other] > alike_m for other in chosen):
            chosen.append(int(mode))
    owner = np.array(chosen)[apart[chosen].argmin(axis=0)]
    mass = np.array([probability[owner == mode].sum() for mode in chosen])
    order = np.argsort(rounded(-mass), kind="stable")
    likeliest = np.array(chosen)[order]
    weights = weights[likeliest] / density[likeliest, None]
    return np.einsum("nm,mli->nli", weights, joints), mass[order], weights
