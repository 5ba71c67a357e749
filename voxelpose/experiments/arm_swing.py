"""The arm-swing experiment of paper A: what nwXOR and the occlusion-aware motion model are good
for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.filter.forward import ForwardFilter, candidates_of
from silhouette_core.filter.person import find_person, upright_distance
from silhouette_core.filter.tree_filter import FilterSettings, TreeFilter
from silhouette_core.filter.window import look_at
from silhouette_core.image.distance import Weighting
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.library.pose_library import PoseLibrary
from silhouette_core.library.rendering import STATURE_PX
from silhouette_core.library.transitions import transitions
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.progress import Reporter
from voxelpose.experiments.degrade import Degradation, degrade
from voxelpose.experiments.swing_library import NEIGHBOURS
from voxelpose.experiments.swings import Verdict, arm_angles, count
from voxelpose.recording.folder import Recording

LONG_SIDE_PX = 640  # the paper's camera
FLOOR = 1e-6
"""Share of the prior spread over the whole library. Next to nothing here: in the paper a lost track
has no second chance.
"""
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
    """What the paper does not state; the same for all methods. docs/results.md shows what another
    reading of (4) does.

    Attributes:
        sigma: of eq. (10), as a share of the silhouette's own weight.
        normalised: of eq. (4), see `silhouette_core.library.transitions.transitions`.
    """

    sigma: float = 0.05
    normalised: bool = True


@dataclass(frozen=True)
class Method:
    """A row of the paper's table.

    Attributes:
        weighting: of the silhouette distance.
        occlusion_aware: DM2; else DM1.
        paper: Fail, Error and Success of 24 in the paper.
    """

    weighting: Weighting
    occlusion_aware: bool
    paper: tuple[int, int, int]

    def __str__(self) -> str:
        """Calls it as the paper does."""
        return f"{self.weighting.replace('xor', 'XOR')}+DM{2 if self.occlusion_aware else 1}"


METHODS = (
    Method("wxor", False, (24, 0, 0)),
    Method("wxor", True, (24, 0, 0)),
    Method("nwxor", False, (7, 7, 10)),
    Method("nwxor", True, (0, 10, 14)),
)


@dataclass(frozen=True, eq=False)
class Film:
    """A recording's silhouettes, as one camera without distortion sees them.

    Attributes:
        camera: that camera.
        fps: frames per second.
        size: (height, width).
        bits: (T, height, width / 8) uint8, silhouettes packed along the columns.
        distance_m: of the person in the first frame, if upright.
        pitch_deg: how far a camera turned toward the person looks down.
    """

    camera: Camera
    fps: float
    size: tuple[int, int]
    bits: NDArray[np.uint8]
    distance_m: float
    pitch_deg: float

    def __len__(self) -> int:
        """Counts the frames."""
        return len(self.bits)

    def mask(self, frame: int) -> NDArray[np.bool_]:
        """Returns the silhouette of a frame, (height, width) bool."""
        return np.unpackbits(self.bits[frame], axis=1, count=self.size[1]).view(bool)

    @classmethod
    def of(cls, recording: Recording, stature_m: float, reporter: Reporter) -> Film:
        """Takes the silhouettes of a recording of one camera.

        Raises:
            InputError: the first frame shows nobody, or there are several cameras.
        """
        if len(recording.rig) != 1:
            raise InputError(
                f"{recording.folder} has {len(recording.rig)} cameras: choose one with --camera"
                " NAME"
            )
        lens = UndistortedView.from_camera(recording.rig.cameras[0], LONG_SIDE_PX)
        silhouettes = Silhouettes(recording, long_side_px=LONG_SIDE_PX)
        reporter.stage("silhouettes", recording.frame_count)
        bits = []
        for _, _, frames in recording:
            person = find_person(lens.undistort(silhouettes.of(frames)[recording.rig.names[0]]))
            mask = np.zeros(lens.pinhole.size[::-1], bool) if person is None else person.mask
            bits.append(np.packbits(mask, axis=1))
            reporter.advance()
        width, height = lens.pinhole.size
        film = cls(lens.pinhole, recording.fps, (height, width), np.stack(bits), 0.0, 0.0)
        first = film.mask(0)
        if not first.any():
            raise InputError(
                f"the first frame of {recording.folder} shows nobody: the experiment wants an arm"
                " that swings all the time"
            )
        distance = upright_distance(film.camera, first, stature_m)
        pitch = np.degrees(look_at(film.camera, first, distance, STATURE_PX / stature_m).pitch_rad)
        return cls(film.camera, film.fps, film.size, film.bits, distance, float(np.round(pitch)))


@dataclass(frozen=True, eq=False)
class Row:
    """What a method made of a film.

    Attributes:
        method: its name.
        degradation: of the silhouettes.
        counts: swings by verdict.
        angles_deg: (T,) the estimated arm.
        error_deg: mean error of the angle over all frames.
        lost: frames in which no pose of the library resembled the silhouette as usual.
        paper: what the paper counted, where it has this row.
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
    """How the arm really moved.

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
        """Judges an estimate; see Row."""
        error = np.abs(angles_deg - self.angles_deg)
        mean = float(np.nanmean(error)) if np.isfinite(error).any() else float("nan")
        return Row(
            method,
            str(degradation),
            count(self.angles_deg, angles_deg, self.swings),
            angles_deg,
            mean,
            lost,
            paper,
        )


def near_side(truth_m: NDArray[np.float64], camera: Camera) -> bool:
    """Says whether the right shoulder is nearer to the camera than the left: truth_m (T, 15, 3),
    world, m; its first known frame counts.
    """
    first = truth_m[np.isfinite(truth_m).all(axis=(1, 2))][0]
    right, left = (
        np.linalg.norm(first[LANDMARK_NAMES.index(f"{side}_shoulder")] - camera.center_m)
        for side in ("right", "left")
    )
    return bool(right < left)


def follow(
    film: Film,
    library: PoseLibrary,
    method: Method,
    degradation: Degradation,
    reading: Reading,
    reporter: Reporter,
) -> tuple[NDArray[np.float64], int]:
    """HypothesisTracker a film as the paper does: the likeliest sample of every frame, eq. (12) and
    (13), from the past alone, unrefined.

    The person stands at one place, at the distance of the first frame, so that distance is not
    estimated.

    Args:
        film: the silhouettes.
        library: poses, from about the film's side.
        method: distance and motion model.
        degradation: what is done to the silhouettes first.
        reading: of what the paper leaves open.
        reporter: told of every frame.

    Returns: (T,) degrees: the right upper arm's angle; NaN where the silhouette is empty. And in
        how many frames the filter was lost.
    """
    matrix = transitions(
        library, method.occlusion_aware, np.sqrt(30.0 / film.fps), NEIGHBOURS, reading.normalised
    )
    tree = TreeFilter(library, matrix, FilterSettings(sigma=reading.sigma, floor=FLOOR))
    filtering = ForwardFilter(
        tree, film.camera, facing=False, weighting=method.weighting, distance_m=film.distance_m
    )
    joints = np.full((len(film), len(LANDMARK_NAMES), 3), np.nan)
    lost = 0
    for frame in range(len(film)):
        person = find_person(
            degrade(film.mask(frame), degradation, np.random.default_rng((_SEED, frame)))
        )
        if person is not None:
            belief = filtering.step(frame, frame / film.fps, person)
            lost += belief.lost
            best = candidates_of(tree, belief, [0])
            joints[frame] = landmarks(
                library.model,
                *forward(
                    library.model, best.root_m, quaternions(best.root_rotation), best.angles_rad
                ),
            )[0]
        reporter.advance()
    return arm_angles(joints), lost


def experiment(
    film: Film,
    truth: Truth,
    library: PoseLibrary,
    degradations: Sequence[Degradation],
    reading: Reading,
    reporter: Reporter,
) -> list[Row]:
    """Runs all methods on a film, as found and degraded.

    Args:
        film: the silhouettes.
        truth: how the arm moved.
        library: poses.
        degradations: of the silhouettes.
        reading: of what the paper leaves open.
        reporter: told of every frame.

    Returns:
        A row per degradation and method.
    """
    rows = []
    for degradation in degradations:
        for method in METHODS:
            reporter.stage(f"{method}, {degradation}", len(film))
            angles, lost = follow(film, library, method, degradation, reading, reporter)
            paper = method.paper if degradation == Degradation() else None
            rows.append(truth.row(str(method), degradation, angles, lost, paper))
    return rows
