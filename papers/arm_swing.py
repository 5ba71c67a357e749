"""The arm-swing experiment of paper A: effect of nwXOR and of the occlusion-aware motion model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.components import label_components
from calib.errors import InputError
from papers.degrade import Degradation, degrade
from papers.swing_library import NEIGHBOURS
from papers.swings import Verdict, arm_angles, count
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.distance import Weighting
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.monocular.person import find_person, upright_distance
from silhouette_core.monocular.tree.forward import ForwardFilter
from silhouette_core.monocular.tree.paper_filter import PaperFilter, initial_prior
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.tuning import FilterSettings
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.kinematics import forward, landmarks
from silhouette_core.progress import Reporter
from voxelpose.recording.folder import Recording

LONG_SIDE_PX = 640  # the paper's camera
FLOOR = 1e-6
"""Fraction of the prior spread over the whole library with the program's additions: negligible. A
lost track recovers by being started again."""
_SEED = 0
DEGRADATIONS = (
    Degradation(),
    Degradation(contour_px=2.0),
    Degradation(contour_px=4.0, grain_px=6.0),
    Degradation(holes=4, hole_radius_px=8.0),
)

Paper = tuple[int, int, int] | None
"""Fail, Error and Success of 24 in the paper; None where it has no such row."""


@dataclass(frozen=True)
class Reading:
    """Interpretation of what the paper does not state; the same for all methods.

    docs/log/libraries.md compares the interpretations of (4).

    Attributes:
        sigma: of eq. (10), as a fraction of the silhouette's own weight.
        normalised: of eq. (4), see `silhouette_core.monocular.tree.transitions.transitions`.
        additions: with this program's additions to the paper, as `voxelpose track` without
            refinement: refined silhouettes with the components near the person, nodes moved by a
            pixel, sigma relative to every frame's silhouette and wider for the coarse levels, a
            uniform initial prior, and half of the prior spread evenly once the track is lost. Else
            section 5.1's silhouettes, of which the largest component, and `PaperFilter`.
    """

    sigma: float = 0.05
    normalised: bool = True
    additions: bool = False


@dataclass(frozen=True)
class Method:
    """A method of the paper's table.

    Attributes:
        weighting: of the silhouette distance.
        occlusion_aware: motion model DM2; else DM1.
        paper: Fail, Error and Success of 24 in the paper.
    """

    weighting: Weighting
    occlusion_aware: bool
    paper: tuple[int, int, int]

    def __str__(self) -> str:
        """Name in the paper."""
        return f"{self.weighting.replace('xor', 'XOR')}+DM{2 if self.occlusion_aware else 1}"


METHODS = (
    Method("wxor", False, (24, 0, 0)),
    Method("wxor", True, (24, 0, 0)),
    Method("nwxor", False, (7, 7, 10)),
    Method("nwxor", True, (0, 10, 14)),
)


@dataclass(frozen=True, eq=False)
class SilhouetteVideo:
    """Silhouettes of a recording of one camera.

    Attributes:
        camera: the camera, without distortion.
        fps: frames per second.
        size: (height, width).
        bits: (T, height, width / 8) uint8, silhouettes packed along the columns.
        distance_m: distance of the person in the first frame, assumed upright.
        pitch_deg: downward angle of a camera turned toward the person.
    """

    camera: Camera
    fps: float
    size: tuple[int, int]
    bits: NDArray[np.uint8]
    distance_m: float
    pitch_deg: float

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.bits)

    def mask(self, frame: int) -> NDArray[np.bool_]:
        """Silhouette of a frame, (height, width) bool."""
        return np.unpackbits(self.bits[frame], axis=1, count=self.size[1]).view(bool)

    @classmethod
    def from_recording(
        cls, recording: Recording, stature_m: float, reporter: Reporter, additions: bool = False
    ) -> SilhouetteVideo:
        """Finds the silhouettes of a recording.

        Args:
            recording: of one camera.
            stature_m: of the person.
            reporter: notified of every frame.
            additions: refined silhouettes instead of those of the paper, see `Reading`.

        Raises:
            InputError: the first frame shows no person, or there are several cameras.
        """
        if len(recording.rig) != 1:
            raise InputError(
                f"{recording.folder} has {len(recording.rig)} cameras: choose one with --camera"
                " NAME"
            )
        view = UndistortedView.from_camera(recording.rig.cameras[0], LONG_SIDE_PX)
        kind = "auto" if additions else "paper"
        silhouettes = Silhouettes(recording, kind, LONG_SIDE_PX)
        reporter.stage("silhouettes", recording.frame_count)
        bits = []
        for _, _, frames in recording:
            mask = view.undistort(silhouettes.of(frames)[recording.rig.names[0]])
            if not additions:
                mask = largest_component(mask)
            else:
                person = find_person(mask)
                mask = np.zeros_like(mask) if person is None else person.mask
            bits.append(np.packbits(mask, axis=1))
            reporter.advance()
        width, height = view.pinhole.size
        video = cls(view.pinhole, recording.fps, (height, width), np.stack(bits), 0.0, 0.0)
        first = video.mask(0)
        if not first.any():
            raise InputError(
                f"the first frame of {recording.folder} shows no person: the experiment needs an"
                " arm that swings all the time"
            )
        distance = upright_distance(video.camera, first, stature_m)
        window = look_at(video.camera, first, distance, STATURE_PX / stature_m)
        pitch_deg = float(np.round(np.degrees(window.pitch_rad)))
        return replace(video, distance_m=distance, pitch_deg=pitch_deg)


@dataclass(frozen=True, eq=False)
class Row:
    """Result of one method on one video.

    Attributes:
        method: its name.
        degradation: of the silhouettes.
        counts: swings by verdict.
        angles_deg: (T,) estimated angle of the right upper arm.
        error_deg: mean error of the angle over all frames.
        lost: number of frames in which the filter was lost.
        paper: counts of the paper, where it has this row.
    """

    method: str
    degradation: str
    counts: Mapping[Verdict, int]
    angles_deg: NDArray[np.float64] = field(repr=False)
    error_deg: float
    lost: int = 0
    paper: Paper = None


@dataclass(frozen=True, eq=False)
class Truth:
    """True motion of the arm.

    Attributes:
        angles_deg: (T,) angle of the right upper arm.
        swings: frames of each swing.
    """

    angles_deg: NDArray[np.float64]
    swings: Sequence[slice]

    def row(
        self,
        method: str,
        degradation: Degradation,
        angles_deg: NDArray[np.float64],
        lost: int = 0,
        paper: Paper = None,
    ) -> Row:
        """Compares an estimate with the truth; see Row for the arguments."""
        error = np.abs(angles_deg - self.angles_deg)
        mean = float(np.nanmean(error)) if np.isfinite(error).any() else float("nan")
        counts = count(self.angles_deg, angles_deg, self.swings)
        return Row(method, str(degradation), counts, angles_deg, mean, lost, paper)


def largest_component(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Largest connected component of a foreground image (h, w) bool; empty if it is."""
    components = label_components(mask)
    if len(components.sizes) < 2:
        return np.zeros_like(mask)
    return components.labels == 1 + int(components.sizes[1:].argmax())


def near_side(truth_m: NDArray[np.float64], camera: Camera) -> bool:
    """Whether the right shoulder is nearer to the camera than the left.

    Args:
        truth_m: (T, 15, 3) metres, world; its first known frame decides.
        camera: the camera.
    """
    first = truth_m[np.isfinite(truth_m).all(axis=(1, 2))][0]
    right, left = (
        np.linalg.norm(first[LANDMARK_NAMES.index(f"{side}_shoulder")] - camera.center_m)
        for side in ("right", "left")
    )
    return bool(right < left)


def track_arm(
    video: SilhouetteVideo,
    library: PoseLibrary,
    method: Method,
    degradation: Degradation,
    reading: Reading,
    reporter: Reporter,
) -> tuple[NDArray[np.float64], int]:
    """Tracks the right arm, as the paper does or with this program's additions.

    The estimate of a frame is the most likely sample given the frames up to it, eq. (12) and (13),
    without refinement. The person stays at the distance of the first frame, which is not estimated.

    Args:
        video: the silhouettes.
        library: poses, seen from about the side of the video.
        method: distance and motion model.
        degradation: applied to the silhouettes first.
        reading: of what the paper does not state, and whether with additions.
        reporter: notified of every frame.

    Returns:
        (T,) degrees, the angle of the right upper arm, NaN where the silhouette is empty; and the
        number of frames in which the filter was lost, which only the program's own notices.
    """
    interval_s = 1 / video.fps
    matrix = transitions(
        library, method.occlusion_aware, 1.0, NEIGHBOURS, reading.normalised, interval_s
    )
    tree = TreeFilter(
        library, matrix, FilterSettings(sigma=reading.sigma, moved=len(library), floor=FLOOR)
    )
    tracker = ForwardFilter(tree, video.camera, method.weighting, video.distance_m, interval_s)
    paper = PaperFilter(
        library,
        matrix,
        video.camera,
        video.distance_m,
        initial_prior(library),
        method.weighting,
        reading.sigma,
        interval_s,
        in_place=True,
    )
    joints = np.full((len(video), len(LANDMARK_NAMES), 3), np.nan)
    lost = 0
    for frame in range(len(video)):
        mask = degrade(video.mask(frame), degradation, np.random.default_rng((_SEED, frame)))
        if not reading.additions:
            mask = largest_component(mask)
            if mask.any():
                found = paper.step(frame * interval_s, mask)
                joints[frame] = _landmarks(library, int(found.samples[0]))
        elif (person := find_person(mask)) is not None:
            filter_frame = tracker.step(frame / video.fps, person.mask)
            lost += filter_frame.lost
            joints[frame] = _landmarks(library, int(filter_frame.posterior.samples[0]))
        reporter.advance()
    return arm_angles(joints), lost


def _landmarks(library: PoseLibrary, sample: int) -> NDArray[np.float64]:
    """Joints (15, 3) of a sample before the library's camera, m, pelvis at the origin."""
    turn, angles = library.pose(np.array([sample]))
    return landmarks(library.model, *forward(library.model, np.zeros((1, 3)), turn, angles))[0]


def run_methods(
    video: SilhouetteVideo,
    truth: Truth,
    library: PoseLibrary,
    degradations: Sequence[Degradation],
    reading: Reading,
    reporter: Reporter,
) -> list[Row]:
    """Runs all methods on a video, with all degradations.

    Args:
        video: the silhouettes.
        truth: true motion of the arm.
        library: poses.
        degradations: of the silhouettes.
        reading: of what the paper does not state.
        reporter: notified of every frame.

    Returns:
        A row per degradation and method.
    """
    rows = []
    for degradation in degradations:
        for method in METHODS:
            reporter.stage(f"{method}, {degradation}", len(video))
            angles, lost = track_arm(video, library, method, degradation, reading, reporter)
            paper = method.paper if degradation == Degradation() else None
            rows.append(truth.row(str(method), degradation, angles, lost, paper))
    return rows
