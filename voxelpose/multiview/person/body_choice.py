"""The person that is fitted: of some candidates the one of least cost, see `posterior`."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter

import numpy as np
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from calib.moments import even_moments
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_SIGMA
from silhouette_core.estimator import Settings
from silhouette_core.motion.dynamics import relaxed_rad
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter
from silhouette_core.ranking import rounded
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.adaptation import Stature, adapt_shape, stature_of
from silhouette_core.refinement.posterior import still_root
from silhouette_core.refinement.refine import RefineStart
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.person.posterior import (
    GIRTH_CAMERAS,
    POSTURES,
    Candidate,
    ShapePrior,
    StatureEvidence,
    chest_from_hull,
    cost_terms,
    hull_volume_m3,
    is_improbable,
    is_unusual,
)
from voxelpose.multiview.person.proposals import (
    FrameProposals,
    proposals_of,
    triangulated_proposals,
)
from voxelpose.multiview.proposers.pose_search import (
    HEADINGS,
    MORE_PLACEMENTS,
    SEARCHED,
    STEP,
    BodyGeometry,
    PoseFit,
    find_pose,
    move_limbs,
    refine_fits,
)
from voxelpose.multiview.proposers.torso_search import find_torso
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tuning import PERSON_COST, PERSON_SEARCH

_BEST = 5
_FEWEST_ANCHORS, _FRAMES_PER_ANCHOR = 5, 60  # frames in which bodies are compared
_STARTS = 3  # poses of a frame from which candidates are refined
_ROUNDS = 2  # of adaptation about the stature that was found
_NO_HULL = (
    "the silhouettes leave no hull of a person's size: look at it with `voxelpose carve RECORDING"
    " --frame 0 --out hull.ply`, and check the silhouettes and the calibration"
)


def find_sitting_pose(body: BodyGeometry, frame: FrameObservation) -> list[PoseFit]:
    """Poses near an upright chair's, best first: the legs begin as a sitting person's and are not
    searched in the hull, where they would be found in a chair's.
    """
    model, points = body.model, frame.grid.occupied_points(frame.occupancy)
    angles = relaxed_rad(model.tree).copy()
    bent_deg = {"thigh.flexion": 80, "thigh.abduction": 8, "shin.flexion": 80}  # on a chair
    for k, name in enumerate(model.tree.dof_names):
        joint = name.partition("_")[2]
        if joint in bent_deg:
            angles[k] = np.radians(bent_deg[joint])
    root = _below_head(model, points)
    headings_deg = np.arange(HEADINGS) * 360 / HEADINGS
    roots = [(root, Rotation.from_euler("z", h, degrees=True).as_matrix()) for h in headings_deg]
    torsos = find_torso(body.body_volume, frame.grid, frame.occupancy, MORE_PLACEMENTS)
    roots += [(torso.root_m, torso.root_rotation) for torso in torsos]
    starts = [RefineStart(Pose(*place, angles), SEARCHED) for place in roots]
    fits = sorted(refine_fits(body, frame.observation, starts), key=attrgetter("error"))
    moved = [move_limbs(body, frame.observation, fit) for fit in fits[:_BEST]]
    return sorted(moved, key=attrgetter("error"))


def _below_head(model: BodyModel, points_m: np.ndarray) -> np.ndarray:
    """Where the root (3,) of an upright body is whose head is the top of a hull (n, 3)."""
    top_m = points_m[:, 2].max()
    crown_m = model.vertices_m[:, 2].max()
    half_head_m = 0.5 * (crown_m - model.joints_m[model.names.index("head"), 2])
    head = points_m[points_m[:, 2] > top_m - half_head_m]
    trunk_m = crown_m - model.joints_m[0, 2]
    return np.append(np.median(head[:, :2], axis=0), top_m - trunk_m)


@dataclass(frozen=True, eq=False)
class Start:
    """What tracking starts from."""

    candidate: Candidate
    body: BodyGeometry  #: with adapted proportions.
    prior: ShapePrior  #: of these.
    evidence: StatureEvidence
    poses: dict[int, Pose]  #: frame -> pose, for the anchor frames that are clear.
    unclear: dict[int, Pose]  #: the same for others, which do not tell which body it is.
    errors: dict[int, float]  #: frame -> silhouette error, for all anchor frames; 1 without a pose.
    proposals: Mapping[int, FrameProposals] = field(default_factory=dict)
    """Frame -> what cameras propose, for anchor frames."""

    def cost(self) -> float:
        """Cost by the anchor frames, see `cost_terms`."""
        poses, model = self.poses | self.unclear, self.body.model
        known = [
            float(proposed.cost(joints_of(model, [poses[t]]))[0])
            for t, proposed in self.proposals.items()
            if t in poses
        ]
        return self.cost_of([*self.errors.values()], known)

    def cost_of(self, errors: list[float], proposed: Sequence[float] = ()) -> float:
        """Cost by the silhouette errors of other frames, and the costs of proposed poses."""
        terms = cost_terms(
            self.candidate, self.body.model, self.prior, errors, self.evidence, proposed
        )
        return float(rounded(sum(terms.values())))


def choose_body(
    observations: ObservationStore,
    settings: Settings,
    matching: MatchSettings,
    reporter: Reporter,
    fps: float,
    known: BodyModel | None = None,
    keep_clothes: bool = False,
    objects: bool = False,
) -> Start:
    """Searches anchor frames without a prior, and adapts a body to them.

    Candidates of other girth and template, and of the stature that was found, are always compared.
    A further pose search, about another stature or of somebody who sits, is made only while the
    best candidate is improbable, see `is_improbable`. Where cameras look the same way, what each
    alone proposes is asked, too. Raises InputError where no frame shows a body.

    Args:
        settings: for stature, chest girth and sex, as far as known.
        fps: frames a second.
        known: the person's body, of which only the clothes are then adapted; None: all of it is.
        keep_clothes: the known body's clothes are kept, too.
        objects: whether something beside the person was left out of the silhouettes.
    """
    frames = anchor_frames(observations)
    if not frames:
        raise InputError(_NO_HULL)
    reporter.stage("first poses", len(frames) + 1)
    evidence = StatureEvidence.from_frames(frames, settings)
    told_m = settings.stature_m if known is None else stature_of(known)
    proposals = triangulated_proposals(observations, [*frames], told_m)
    if proposals or evidence.is_far_open:
        proposals = proposals or proposals_of(observations, [*frames], fps, told_m)
        if proposals:
            metres = float(np.median([one.stature_m for one in proposals.values()]))
            evidence = replace(evidence, proposed_m=metres)
    voxel_size_m = observations.observer.voxel_size_m
    search = _Search(frames, settings, matching, objects, voxel_size_m, evidence, proposals)
    starts = search.of_anybody() if known is None else search.of_known(known, keep_clothes)
    best: Start | None = None
    for start in starts:
        best = start if best is None else min(best, start, key=Start.cost)
        if not is_improbable(best.errors.values()):
            break
    if best is None:
        raise InputError(_NO_HULL)
    if known is None and settings.stature_m is None:
        reporter.note(
            f"no stature given: about {best.prior.stature.metres:.2f} m by the silhouettes"
            " (--stature makes every joint more accurate)"
        )
    reporter.advance(len(frames) + 1)
    return best


def anchor_frames(observations: ObservationStore) -> dict[int, FrameObservation]:
    """Some frames of a recording in which a body is seen, by number: about evenly spaced, where
    others hide least of it.
    """
    present, hidden = np.flatnonzero(observations.there), observations.hidden
    if not len(present):
        return {}
    most = max(_FEWEST_ANCHORS, len(present) // _FRAMES_PER_ANCHOR)
    even = present[even_moments(len(present), most)]
    between = present[(present >= even[0]) & (present <= even[-1])]
    nearest = np.abs(between[:, None] - even).argmin(axis=1)
    chosen = [
        min(between[nearest == k].tolist(), key=lambda t: (hidden[t], abs(t - middle)))
        for k, middle in enumerate(even.tolist())
    ]
    return {t: frame for t in chosen if (frame := observations.observe(t)) is not None}


def clear_fits(fits: dict[int, PoseFit]) -> dict[int, PoseFit]:
    """Fits of the frames in which they explain the silhouettes nearly as well as in the best."""
    best = min(fit.error for fit in fits.values())
    return {t: fit for t, fit in fits.items() if not is_unusual(fit.error, best)}


def adapted(start: Start, frames: Mapping[int, FrameObservation]) -> Start:
    """Start, and errors, with its body adapted to its poses; one that stays is left so."""
    if start.prior.covariance is None:
        return start
    observed = [frames[t] for t in start.poses]
    observations, volume = [one.observation for one in observed], start.body.body_volume
    poses, prior = list(start.poses.values()), start.prior
    surface, poses = adapt_shape(
        start.body.surface, observations, poses, prior.stature, prior.expected, prior.covariance
    )
    errors = [
        silhouette_error(surface.model, pose, observation, volume.backend)
        for pose, observation in zip(poses, observations, strict=True)
    ]
    voxel_size_m = observed[0].grid.voxel_size_m
    body = BodyGeometry.from_surface(surface, voxel_size_m, volume.backend_name)
    unclear = {
        t: refine_fits(body, frames[t].observation, [RefineStart(pose, STEP)])[0]
        for t, pose in start.unclear.items()
    }
    return replace(
        start,
        body=body,
        poses=dict(zip(start.poses, poses, strict=True)),
        unclear={t: fit.pose for t, fit in unclear.items()},
        errors=start.errors
        | dict(zip(start.poses, errors, strict=True))
        | {t: fit.error for t, fit in unclear.items()},
    )


PoseSearch = Callable[[BodyGeometry, FrameObservation], list[PoseFit]]
"""Searches the poses of a frame, best first."""


@dataclass(frozen=True, eq=False)
class _Search:
    """Candidates for the person in some frames; attributes as of `choose_body`."""

    frames: dict[int, FrameObservation]
    settings: Settings
    matching: MatchSettings
    objects: bool
    voxel_size_m: float
    evidence: StatureEvidence
    proposals: Mapping[int, FrameProposals]

    def of_known(self, model: BodyModel, keep_clothes: bool) -> Iterator[Start]:
        """Starts with a person's body, whose clothes are adapted unless they are kept."""
        body = BodyGeometry.from_model(model, self.voxel_size_m, self.settings.backend)
        metres = stature_of(model)
        sigma = np.where(IS_CLOTHING, SHAPE_SIGMA, 1e-4)  # but for clothes, none
        expected = model.shape if keep_clothes else np.where(IS_CLOTHING, 0.0, model.shape)
        covariance = None if keep_clothes else np.diag(sigma**2)
        prior = ShapePrior(Stature(metres, PERSON_COST.told_sigma_m), expected, covariance)
        for posture in POSTURES:
            fits = {t: best[0] for t, best in self._found(body, posture).items() if best}
            if fits:
                candidate = Candidate(metres, None, model.sizes.sex, posture, self.objects)
                start = self._start(candidate, body, prior, StatureEvidence(metres), fits)
                yield adapted(start, self.frames)

    def of_anybody(self) -> Iterator[Start]:
        """Starts with candidates for an unknown person, a pose search each."""
        for posture in POSTURES:
            for statures_m in self.evidence.statures_m(posture):
                first = self._refined(posture, statures_m)
                if first is not None:
                    yield self._settled(first)

    def _refined(self, posture: str, statures_m: tuple[float, ...]) -> Start | None:
        """The best body about some statures, not adapted, with poses refined from a search."""
        starts: dict[int, list[RefineStart]] = {}
        for metres in statures_m:
            body = self._body(Candidate(metres, self.settings.chest_m, self._templates[0]))
            for t, best in self._found(body, posture).items():
                taken = [RefineStart(fit.pose, SEARCHED) for fit in best[:_STARTS]]
                starts[t] = starts.get(t, []) + taken
        if not any(starts.values()):
            return None
        step = PERSON_SEARCH.stature_step
        evidence = self.evidence
        scales = (1.0,) if evidence.told_m is not None else (1 / step, 1.0, step)
        candidates = [
            Candidate(metres * scale, girth, self._templates[0], posture, self.objects)
            for metres in statures_m
            for scale in scales
            for girth in self._girths(metres * scale)
        ]

        def refined(candidate: Candidate) -> Start:
            body = self._body(candidate)
            best = {
                t: refine_fits(body, frame.observation, starts[t])
                for t, frame in self.frames.items()
            }
            fits = {t: self._ranked(t, body, poses)[0] for t, poses in best.items() if poses}
            return self._start(candidate, body, _prior(candidate, body, evidence), evidence, fits)

        return min(side_by_side(refined, candidates), key=Start.cost)

    def _settled(self, first: Start) -> Start:
        """The best body of either girth and template, adapted, about the stature found so."""
        base = first.candidate
        best = self._best(
            first, [replace(base, girth=girth) for girth in self._girths(base.stature)]
        )
        for _ in range(_ROUNDS if first.evidence.told_m is None else 0):
            # What the first body was too tall by would stay in the proportions: its are the prior.
            base, stature = best.candidate, stature_of(best.body.model)
            girth = None if base.girth is None else base.girth * stature / base.stature
            second = self._best(best, [replace(base, stature=stature, girth=girth)])
            if second.cost() >= best.cost():
                break
            best = second
        return best

    def _best(self, start: Start, candidates: list[Candidate]) -> Start:
        """The best of some candidates with each template, adapted to the poses of a start."""

        def of(candidate: Candidate) -> Start:
            body = self._body(candidate)
            prior = _prior(candidate, body, start.evidence)
            return adapted(replace(start, candidate=candidate, body=body, prior=prior), self.frames)

        every = [replace(one, template=name) for one in candidates for name in self._templates]
        return min(side_by_side(of, every), key=Start.cost)

    def _start(
        self,
        candidate: Candidate,
        body: BodyGeometry,
        prior: ShapePrior,
        evidence: StatureEvidence,
        fits: dict[int, PoseFit],
    ) -> Start:
        clear = clear_fits(fits)
        poses = {t: fit.pose for t, fit in clear.items()}
        unclear = {t: fit.pose for t, fit in fits.items() if t not in clear}
        errors = {t: fits[t].error if t in fits else 1.0 for t in self.frames}
        return Start(candidate, body, prior, evidence, poses, unclear, errors, self.proposals)

    def _found(self, body: BodyGeometry, posture: str) -> dict[int, list[PoseFit]]:
        """Poses of all frames that a search finds, best first."""
        upright: PoseSearch = partial(find_pose, settings=self.matching)
        search = find_sitting_pose if posture == "sitting" else upright

        def of(t: int) -> list[PoseFit]:
            frame, fits = self.frames[t], search(body, self.frames[t])
            if t in self.proposals:
                placed = self.proposals[t].starts(body.surface, frame.observation)
                starts = [RefineStart(pose, SEARCHED) for pose in placed]
                fits = [*fits, *refine_fits(body, frame.observation, starts)]
            return self._ranked(t, body, fits)

        return dict(zip(self.frames, side_by_side(of, [*self.frames]), strict=True))

    def _ranked(self, t: int, body: BodyGeometry, fits: list[PoseFit]) -> list[PoseFit]:
        """Poses of a frame, best first by their errors and what cameras propose."""
        costs = PERSON_COST.frame_residuals * np.log([fit.error for fit in fits])
        if fits and t in self.proposals:
            poses = [fit.pose for fit in fits]
            costs = costs + self.proposals[t].cost(joints_of(body.model, poses))
        return [fits[k] for k in np.argsort(rounded(costs), kind="stable")]

    @property
    def _templates(self) -> tuple[str, ...]:
        sex = self.settings.sex
        return ("male", "female") if sex == "unknown" else (sex,)

    def _girths(self, metres: float) -> list[float | None]:
        """The chest girth that is known, else the usual one and the hull's."""
        frames = list(self.frames.values())
        if self.settings.chest_m is not None or len(frames[0].masks) < GIRTH_CAMERAS:
            return [self.settings.chest_m]
        volume_m3 = float(np.median([hull_volume_m3(frame) for frame in frames]))
        usual = BodyModel.from_sizes(Candidate(metres, None, self._templates[0]).sizes)
        return [None, chest_from_hull(usual, volume_m3)]

    def _body(self, candidate: Candidate) -> BodyGeometry:
        model = BodyModel.from_sizes(candidate.sizes)
        return BodyGeometry.from_model(model, self.voxel_size_m, self.settings.backend)


def _prior(candidate: Candidate, body: BodyGeometry, evidence: StatureEvidence) -> ShapePrior:
    """Of the body of a candidate for an unknown person."""
    stature = evidence.prior(candidate.stature)
    return ShapePrior(stature, body.model.shape, np.diag(SHAPE_SIGMA**2))


def start_given(
    observations: ObservationStore,
    settings: Settings,
    matching: MatchSettings,
    reporter: Reporter,
    model: BodyModel,
) -> tuple[BodyGeometry, dict[int, PoseFit]]:
    """Searches anchor frames without a prior, with a body that stays as it is.

    A root that stands still is placed once, by all anchor frames together. Raises InputError where
    no frame shows a body.

    Returns:
        The body, and the fits of the frames in which it explains the silhouettes nearly as well as
        in the best.
    """
    frames = anchor_frames(observations)
    reporter.stage("first poses", max(len(frames), 1))
    voxel_size_m = observations.observer.voxel_size_m
    body = BodyGeometry.from_model(model, voxel_size_m, settings.backend)
    fits = _searched(body, frames, matching)
    if fits and model.tree.root_fixed:
        best = min(fits.values(), key=lambda fit: fit.error)
        fits = _searched(replace(body, root=best.pose), frames, matching)
        seen, poses = [frames[t].observation for t in fits], [fit.pose for fit in fits.values()]
        root = still_root(body.surface, seen, poses, SEARCHED)
        body = replace(body, root=root)
        fits = _searched(body, frames, matching)
    reporter.advance(max(len(frames), 1))
    if not fits:
        raise InputError(
            "the silhouettes leave no hull in which the body is found: look at it with `voxelpose"
            " carve RECORDING --frame 0 --out hull.ply`, and check the silhouettes, the"
            " calibration and the body's size"
        )
    for group in sorted({group for fit in fits.values() for group in fit.stopped}):
        reporter.note(
            f"the joint search of {', '.join(group)} stopped at its bound of memory or work: the"
            " best of what it had tried stands (larger voxels make it shorter)"
        )
    return body, clear_fits(fits)


def _searched(
    body: BodyGeometry, frames: dict[int, FrameObservation], matching: MatchSettings
) -> dict[int, PoseFit]:
    fits = side_by_side(lambda frame: find_pose(body, frame, matching)[:1], list(frames.values()))
    return {t: fit for t, best in zip(frames, fits, strict=True) for fit in best}
