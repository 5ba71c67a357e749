"""Fig. 4 of paper A: how nwXOR and the occlusion-aware motion model follow a swinging arm."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from papers.swing_film import FPS, SwingFilm
from papers.swing_library import NEIGHBOURS
from papers.swings import Verdict, arm_angles, count, split_swings
from silhouette_core.monocular.person import upright_distance
from silhouette_core.monocular.tree.paper_filter import PaperFilter, initial_prior
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX, silhouette_levels
from silhouette_core.monocular.tree.transitions import step_precisions, transitions
from silhouette_core.monocular.window import Window, look_at
from silhouette_core.motion.kinematics import forward, landmarks
from silhouette_core.scoring.backend import Target
from silhouette_core.scoring.cpu import CpuBackend

MotionModel = Literal["density", "normalised", "kernel"]
"""How (4) is read. "density": the normal density as it is written, whose factor is smaller where a
part is hidden and its deviation larger; (14) adds up its values at the samples. That is the
paper's: nothing in it divides by their sum. "normalised": the same, every row divided by its sum
over the library. "kernel": its exponential alone. With DM1 density and kernel are the same."""


@dataclass(frozen=True)
class Method:
    """A method of the paper's table.

    Attributes:
        weighting: of the silhouette distance, in the tree as in the likelihood.
        occlusion_aware: motion model DM2; else DM1.
        paper: Fail, Error and Success of 24 in the paper.
    """

    weighting: str
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


@dataclass(frozen=True)
class Case:
    """A method with what the paper leaves open.

    Attributes:
        method: distance and occlusion awareness.
        model: reading of (4).
        sigma: of (10), as a fraction of the weight of the first frame's silhouette.
    """

    method: Method
    model: MotionModel
    sigma: float

    def __str__(self) -> str:
        """Short description."""
        return f"{self.method}, (4) {self.model}, σ {self.sigma:g}"


@dataclass(frozen=True, eq=False)
class Row:
    """Result of one case on one film.

    Attributes:
        case: what was tracked with.
        counts: swings by verdict.
        angles_deg: (T,) estimated angle of the right upper arm.
        error_deg: mean error of the angle over all frames.
    """

    case: Case
    counts: dict[Verdict, int]
    angles_deg: NDArray[np.float64]
    error_deg: float


def step_matrix(library: PoseLibrary, occlusion_aware: bool, model: MotionModel) -> csr_matrix:
    """Motion model (4) with DM1 or DM2, over the nearest samples, (N, N)."""
    normalised = model == "normalised"
    matrix = transitions(library, occlusion_aware, 1.0, NEIGHBOURS, normalised, 1 / FPS)
    if model == "density" and occlusion_aware:
        joints, root = step_precisions(library, library.occluded)
        free = ~library.model.tree.dof_fixed
        log_factor = 0.5 * np.log(joints[:, free]).sum(axis=1) + 1.5 * np.log(root)
        factor = np.exp(log_factor - log_factor.max())
        matrix.data *= np.repeat(factor, np.diff(matrix.indptr)).astype(np.float32)
    return matrix


def sample_angles(library: PoseLibrary) -> NDArray[np.float64]:
    """Angle (N,) of the right upper arm of every sample, degrees."""
    turn, angles = library.pose(np.arange(len(library)))
    origin = np.zeros((len(library), 3))
    joints_m = landmarks(library.model, *forward(library.model, origin, turn, angles))
    return arm_angles(joints_m)


def person_distance(film: SwingFilm, library: PoseLibrary) -> float:
    """Distance of the library's body, upright, that is as high as the person in the first frame."""
    return upright_distance(film.camera, film.mask(0), library.model.length_m)


def sample_costs(
    mask: NDArray[np.bool_], library: PoseLibrary, level: int = -1
) -> NDArray[np.float64]:
    """Distance (N,) of a window's silhouette from the node of every sample on a level, by the
    library's own weighting.
    """
    nodes, mask = library.levels[level], silhouette_levels(mask)[level]
    weights = library.settings.weights(mask, library.bounds_px)
    target = Target((mask,), (weights,), scale=1 / mask.size)
    cost = CpuBackend().span_distances(target, nodes.spans, np.arange(len(nodes)))[:, 0]
    for offsets in library.child_offsets[level:]:
        cost = np.repeat(cost, np.diff(offsets))
    of_samples = np.empty(len(library))
    of_samples[library.leaf_samples] = cost
    return of_samples


def window_of(film: SwingFilm, frame: int, library: PoseLibrary) -> NDArray[np.bool_]:
    """Silhouette (240, 320) of a frame as the library's camera would see it."""
    metre_px, distance_m = STATURE_PX / library.model.length_m, person_distance(film, library)
    return look_at(film.camera, film.mask(frame), distance_m, metre_px).mask


class _TogetherFilter(PaperFilter):
    """Filter by the library's distance, which shares what it makes of a frame with others of it."""

    made: dict[int, Any]  # window and targets of the frame, emptied before the next

    def _window(self, mask: NDArray[np.bool_], factor: float) -> Window:
        return self.made.get(0) or self.made.setdefault(0, super()._window(mask, factor))

    def _target(self, window: Window, reduction: int) -> Target:
        made = self.made
        return made.get(reduction) or made.setdefault(reduction, super()._target(window, reduction))

    def _weights(self, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        return self.library.settings.weights(mask, self.library.bounds_px)


def track_arm(film: SwingFilm, library: PoseLibrary, cases: Sequence[Case]) -> list[Row]:
    """Tracks the right arm as the paper does, without anything that this program adds.

    The estimate of a frame is the most likely sample given the frames up to it, eq. (12) and (13).
    The person stays at the distance of the first frame, which is not estimated.

    Args:
        film: the silhouettes.
        library: poses, seen from about the side of the film, in a tree by the cases' distance.
        cases: of one distance, which are tracked side by side.

    Returns:
        A row for each.
    """
    first, distance_m, made = initial_prior(library), person_distance(film, library), {}
    trackers = []
    for case in cases:
        matrix = step_matrix(library, case.method.occlusion_aware, case.model)
        tracker = _TogetherFilter(
            library, matrix, film.camera, distance_m, first, CpuBackend(), case.sigma, 1 / FPS, True
        )
        tracker.made = made
        trackers.append(tracker)
    angles, found = sample_angles(library), np.full((len(cases), len(film)), np.nan)
    for frame in range(len(film)):
        mask = film.mask(frame)
        made.clear()
        for tracker, row in zip(trackers, found, strict=True):
            if mask.any():
                row[frame] = angles[tracker.step(frame / FPS, mask).samples[0]]
    swings = split_swings(film.truth_deg)
    return [
        Row(
            case,
            count(film.truth_deg, row, swings),
            row,
            float(np.nanmean(np.abs(row - film.truth_deg))),
        )
        for case, row in zip(cases, found, strict=True)
    ]
