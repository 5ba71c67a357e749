"""Tuned numbers of the multi-view estimator: name, unit, what each does, where it comes from."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Tracking:
    """The step from a pose to that of the next frame, off line and live (`tracking`)."""

    lost: float = 0.45
    """1. Largest error of a pose that is kept. Chosen by eye; right ones have 0.06 to 0.10."""
    longest_steps: float = 6.0
    """1 / FPS. Time after which process noise grows no more, and no step reaches the pose. Tuned on
    walk4 by `python -m benchmarks.follower --every 3 --late 2`."""


@dataclass(frozen=True)
class OffLine:
    """Candidates for a whole recording's poses (`tracking.tracking`)."""

    limbs_again_s: float = 0.5
    """s. Time between the frames in which arms and legs are searched. Chosen by eye."""
    frame_residuals: float = 16.0
    """1. As `PersonCost.frame_residuals`, between poses of one body. dance8, 1522, opencap_walk,
    244 (root_mm): 8 30.7, 50.4, 63.6, 17.7; 16 25.5, 59.8, 63.6, 17.7; 32 25.5, 83.5, 63.6, 18."""
    same_m: float = 0.03
    """m. Distance of every joint within which two candidates are one pose. opencap_walk (root_mm,
    silhouette error): 0.05 67.8 and 0.0794, 0.03 65.6 and 0.0774, 0.02 65.9 and 0.0775."""


@dataclass(frozen=True)
class Live:
    """What the live follower does beside the step (`tracking.follower`, `tracking.track_jobs`)."""

    poor_again_s: float = 0.7
    """s. Least time between searches where poses are bad. Chosen by eye."""
    limbs_again_s: float = 3.0
    """s. Least time between searches of arms and legs where nothing is wrong. Chosen by eye."""
    apart_s: tuple[float, ...] = (0.4, 1.5, 4.0)
    """s. Time between these, for a first adaptation and for later ones. Chosen by eye."""
    foreground: float = 0.002
    """1. Least fraction of a picture that a person takes. Chosen by eye."""
    longest_step_s: float = 0.14
    """s. Longest step of a track that catches up: frames are passed over up to it. Tuned on walk4
    by `python -m benchmarks.follower --every 3 --late 2`."""


@dataclass(frozen=True)
class Carving:
    """The visual hull, and one body's part of it (`carving`)."""

    voxel_m: float = 0.025
    """m. Edge of the voxels that are matched, and of those of objects. By eye."""
    limb_m: float = 1.0
    """m. A leg's length with the foot: as far one camera's silhouette may show the body alone, and
    as far from somebody's axis the hull may be that person's. Without the latter seed 11, two
    people before three cameras, has 48 mm instead of 29. So far from the last position a
    component's weight falls to 1 / e."""
    shrinkage: float = 0.9
    """1. Of a box's volume, or of the placements of limbs, above which reducing them ends: it costs
    no accuracy."""
    joined: float = 0.5
    """1. Of a given body's extent: pieces so near to each other are its. By eye."""
    small: float = 0.03
    """1. Of a silhouette or a hull: what is smaller is no limb. Chosen by eye."""
    gap_m: float = 0.25
    """m. Height of a gap between pieces of one body. Chosen by eye, on standing4."""
    bounding: float = 0.1
    """1. Of a silhouette's largest component: smaller ones do not bound the volume. By eye."""
    smallest_m3: float = 0.004
    """m³. A smaller hull is noise, not a body. Chosen by eye."""
    person_m3: float = 0.25
    """m³. A person's hull is up to so large; larger ones count for less. standing4: board and man
    have 0.37 and 0.15."""
    person_m: float = 1.6
    """m. In most poses it is so long; shorter ones count for less. As `person_m3`. Of static
    things, what is so long may be the person, and the body that of something else."""
    unlikely: float = 2.5
    """1. Hulls so many times larger or smaller than people are in a wrong unit. By eye."""
    off_axis: float = 1.5
    """1. Largest magnification toward an image's corners. An assumption about lenses."""

    @property
    def coarse_m(self) -> float:
        """Voxels in which a body is looked for, m; twice as far its window reaches."""
        return 2 * self.voxel_m


@dataclass(frozen=True)
class Matching:
    """Paper B's matching of limbs, and the search for the torso before it (`matching`)."""

    step_deg: float = 15.0
    """Degrees. Distance between sampled angles. Chosen by eye; Iiyama does not state his."""
    matched_again: int = 3
    """Placements of the torso whose limbs are matched again. Of 70 single frames (seeds 121 to 124,
    211 to 220) searched live, 6 are over 100 mm off; with one placement, and one below, 8."""
    searched: int = 2
    """Poses whose limbs are searched on the silhouettes. As `matched_again`."""
    taken_cost: float = 0.7
    """Voxels. Cost of a part's voxel inside a part that is already placed; in empty space it is
    one. With 1, without `lying_cost` and with `searched` 3: dance8 24.0 to 30.4 (root_mm)."""
    lying_cost: float = 0.1
    """1. Of the torso: cost of lying on the side, as people mostly stand. As `taken_cost`."""
    apart_m: float = 0.12
    """m. Distance from which placements of the torso are different. Chosen by eye."""
    apart_deg: float = 40.0
    """Degrees. The same of turns, also of a limb whose turn is to show. Chosen by eye."""
    visible: float = 0.2
    """1. Of a limb's points, which leave its volume in a turn that shows. Chosen by eye."""


@dataclass(frozen=True)
class Evidence:
    """What speaks for and against a fitted pose (`quality`)."""

    square_m: float = 0.12
    """m. Half the side of the square around a joint. Chosen by eye."""
    least: float = 0.01
    """1. Share below which a joint's surroundings count as alike. Chosen by eye."""
    most_turned: float = 4.0
    """1. Largest half-turn ratio that counts. Chosen by eye."""
    least_seen: float = 0.3
    """1. Of such a square, which must be known. Chosen by eye."""
    at_limit_rad: float = 0.02
    """Radians. From an angle's limit, up to which it is at it. Chosen by eye."""
    unsupported: float = 0.2
    """1. Overlap with the hull below which a part is unsupported. Chosen by eye."""


TRACKING = Tracking()
OFF_LINE = OffLine()
LIVE = Live()


@dataclass(frozen=True)
class People:
    """How many people there are, and where (`people.presence`)."""

    reach_m: float = 0.3
    """m. How far from somebody's axis the hull is that person's: the trunk, and most of the limbs.
    With 0.45 a small woman who walks 0.7 m beside a tall man is lost in three of four frames (seed
    52 of level 2); in 37 other recordings both find the same people."""
    upright_m: float = 1.0
    """m. Height above the floor that the hull of somebody reaches who sits or stands, as everybody
    does at some time. Who crouches is half as high: one of seed 205 is less than 1 m at times."""
    seen_m2: float = 0.5
    """m². Of a person, as seen from a side: by it the pixels that nobody explains are counted."""
    needed: float = 0.15
    """1. Share of a person's silhouette, in the mean camera, that nobody else explains. With 0.25
    one of two people vanishes who pass at 0.6 m before four cameras; a stand has 0.1."""
    appearing: float = 1.0
    """1. Cost of somebody who appears or vanishes: a whole person not explained in one frame."""
    speed_m_s: float = 2.0
    """m/s. Standard deviation of people's speed, who may run. With 1 who runs is lost for half a
    second (seed 46); 2 to 4 change nobody in 22 recordings."""


CARVING = Carving()
PEOPLE = People()
MATCHING = Matching()
QUALITY = Evidence()


@dataclass(frozen=True)
class PersonCost:
    """Terms of a person's cost (`person.posterior`): negative logarithms of probabilities."""

    frame_residuals: float = 8.0
    """1. Residuals of a frame that count as independent of each other: term `silhouettes`. Tuned as
    100 for twelve frames, by which template is right in seeds 201 to 250 of level 1."""
    usual_error: float = 0.08
    """1. Median silhouette error of a right body: term `noise`. Right ones of random recordings
    have 0.06 to 0.10."""
    error_sigma: float = 0.3
    """1. Standard deviation of that error's logarithm from one recording to another: term `noise`.
    By the same range, twice as wide for level 2."""
    improbable_sigmas: float = 2.0
    """1. Standard deviations above the usual error from which costly candidates are searched, too:
    an error of 0.146; 0.15 was tuned for sitting people (701 to 704 of `benchmarks.seated`)."""
    hull_sigma: float = 0.05
    """1. Standard deviation of a stature's logarithm about the hull's height: term `hull`. By
    eye."""
    middle_m: float = 0.2
    """m. From the hull's middle, within which its height is taken: a torso's radius. Largest height
    of five frames over the stature, logarithm, 5 to 95 %, seeds 201 to 224: two cameras -0.04 to
    0.05 (all of the hull -0.03 to 0.26), three -0.06 to 0.03 (0.05), four -0.06 to 0.02 (0.02)."""
    adult_sigma_m: float = 0.12
    """m. Standard deviation of statures about the usual one: term `stature`. ANSUR II has 0.09 for
    men and women together; other peoples and youths widen it by eye."""
    told_sigma_m: float = 0.006
    """m. Standard deviation of a stature that was told: term `stature`. Shoes and tape, by eye."""
    unusual: float = 0.05
    """1. Probability that somebody sits all the time, and that something came with the person and
    stays: terms `posture`, `objects`. Chosen, not measured; of twelve ordinary recordings none
    showed anything."""


@dataclass(frozen=True)
class Proposals:
    """What each camera alone proposes (`person.proposals`)."""

    stature_sigma: float = 0.04
    """1. Standard deviation of the logarithm of a stature by the distance at which each camera
    takes a person of the usual one to be. Seeds 1201 to 1204 have 0.01; silhouettes of real rooms
    lack more: by eye."""


@dataclass(frozen=True)
class PersonSearch:
    """Candidates for a person, and frames in which they are compared (`person`)."""

    stature_step: float = 1.07
    """1. Ratio of neighbouring statures that are tried; adaptation bridges half of it."""


@dataclass(frozen=True)
class HullGirth:
    """Girth by the volume of the hull (`person.girth`)."""

    hull_over_body: float = 1.75
    """1. Volume of the hull of four to eight cameras over that of people of usual girth, measured
    on random recordings."""


@dataclass(frozen=True)
class StaticObjectSearch:
    """What came with the person and stays (`silhouettes.static_objects`).

    Chosen on seeds 701 to 704 of `benchmarks.seated`, not ablated.
    """

    beside_m: float = 0.03
    """m. From the body's outline, within which a silhouette is the body's; an object's pixels are
    widened as far, and by a pixel more."""
    always: float = 0.9
    """1. Share of frames in which an object's pixel is foreground."""
    seen: float = 0.25
    """1. Share of frames in which the body does not hide it."""
    apart_m: float = 0.15
    """m. From the body's surface: what is farther away in all frames is no limb (standing4). While
    no part of the body goes so far, anything may seem static."""


@dataclass(frozen=True)
class CameraRepair:
    """Cameras that were turned or come late (`silhouettes.camera_repair`)."""

    most_turned_deg: float = 5.0
    """Degrees. A larger turn is no bump: somebody should look. By eye."""


@dataclass(frozen=True)
class Completion:
    """Silhouettes completed where clothes resemble the background (`silhouettes.completion`).

    Tuned on seeds 212, 322, 325 and 344 of level 2 by `benchmarks.completed`.
    """

    hole_share: float = 2e-3
    """1. Holes in what may belong to a silhouette are filled up to this share of the image."""


@dataclass(frozen=True)
class UpSearch:
    """Which way is up (`silhouettes.up_search`)."""

    sure: float = 0.75
    """1. Cameras' worth from which, on average, they stand upright. By eye."""
    clearly: float = 0.3
    """1. By which one direction must lie along the trunks more than another. By eye, on
    `benchmarks.turned`."""


PERSON_COST, PERSON_SEARCH, PROPOSALS = PersonCost(), PersonSearch(), Proposals()
HULL_GIRTH = HullGirth()
STATIC_OBJECTS, CAMERA_REPAIR = StaticObjectSearch(), CameraRepair()
COMPLETION, UP_SEARCH = Completion(), UpSearch()
