"""Numbers of the multi-view estimator that were chosen, each with its unit and where it is from."""

from dataclasses import dataclass


@dataclass(frozen=True)
class PersonCost:
    """Terms of a person's cost (`person.posterior`): negative logarithms of probabilities."""

    frame_residuals: float = 8.0
    """1. Residuals of a frame that count as independent of each other: term `silhouettes`. Tuned
    as 100 for twelve frames, by which template is right in seeds 201 to 250 of level 1."""
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
    """1. Standard deviation of a stature's logarithm about the hull's height: term `hull`. Source
    unknown: chosen by eye, not ablated."""
    hull_farthest_sigmas: float = 3.0
    """1. Standard deviations beyond which the hull's height says nothing, of who crouches or
    reaches up: term `hull`. As a factor 1.16; 1.15 stood for it, chosen by eye."""
    adult_m: float = 1.70
    """m. Mean of the statures: term `stature`. ANSUR II has 1.756 for men, 1.629 for women."""
    adult_sigma_m: float = 0.12
    """m. Their standard deviation: term `stature`. ANSUR II has 0.09 for men and women together;
    other peoples and youths widen it by eye."""
    told_sigma_m: float = 0.006
    """m. Standard deviation of a stature that was told: term `stature`. Shoes and tape, by eye."""
    sitting: float = 0.05
    """1. Probability that somebody sits all the time: term `posture`. Chosen, not measured."""
    objects: float = 0.05
    """1. Probability that something came with the person and stays: term `objects`. Chosen, not
    measured; of twelve ordinary recordings none showed anything."""


@dataclass(frozen=True)
class PersonSearch:
    """Candidates for a person, and frames in which they are compared (`person`)."""

    frames_per_anchor: int = 60
    """Frames of a recording for each in which bodies are compared. Source unknown: by eye."""
    fewest_anchors: int = 5
    """Of these frames, at least. Source unknown: by eye."""
    clear: float = 1.4
    """1. A frame is used where its error is below so many times the smallest one's. By eye."""
    stature_step: float = 1.07
    """1. Ratio of neighbouring statures that are tried; adaptation bridges half of it."""
    known_sigma: float = 1e-4
    """1. Standard deviation of all axes of a known body but its clothes: none."""


@dataclass(frozen=True)
class HullGirth:
    """Girth by the volume of the hull (`person.girth`)."""

    hull_over_body: float = 1.75
    """1. Volume of the hull of four to eight cameras over that of people of usual girth, measured
    on random recordings."""
    usual_chest: float = 0.55
    """1. Chest girth of the man's template over its stature."""
    least: float = 0.9
    """1. Smallest girth by a hull, relative to the usual one. By eye."""
    most: float = 1.5
    """1. Largest one: beyond, the hull holds other things. By eye."""


@dataclass(frozen=True)
class SittingSearch:
    """Search for sitting postures (`person.sitting`)."""

    thigh_flexion_deg: float = 80.0
    """deg. Flexion of hip and knee on a chair, by eye."""
    thigh_abduction_deg: float = 8.0
    """deg. Abduction of the hips, by eye."""
    head_m: float = 0.12
    """m. Of the hull below its top, which is taken for the head: half of a head's height."""


@dataclass(frozen=True)
class StaticObjectSearch:
    """What came with the person and stays (`silhouettes.static_objects`).

    Chosen on seeds 701 to 704 of `benchmarks.seated`, not ablated.
    """

    voxel_m: float = 0.025
    """m. Edge of the voxels of an object."""
    beside_m: float = 0.03
    """m. From the body's outline, within which a silhouette is the body's."""
    widened_m: float = 0.04
    """m. By which an object's pixels are widened: as far, and a pixel more."""
    always: float = 0.9
    """1. Share of frames in which an object's pixel is foreground."""
    seen: float = 0.25
    """1. Share of frames in which the body does not hide it."""
    least_m3: float = 0.002
    """m³. Smallest volume of an object: half of a lower leg."""
    apart_m: float = 0.15
    """m. From the body's surface: what is farther away in all frames is no limb (standing4)."""
    person_m: float = 1.4
    """m. What is so long may be the person, and the body that of something else (standing4)."""


@dataclass(frozen=True)
class CameraRepair:
    """Cameras that were turned or come late (`silhouettes.camera_repair`)."""

    subframe: float = 0.6
    """Frames. A smaller offset cannot be corrected by whole frames."""
    most_turned_deg: float = 5.0
    """deg. A larger turn is no bump: somebody should look. By eye."""
    improved: float = 0.5
    """1. Share of the error that may be left by a repair which is sure although not all cameras
    agree yet. Tuned on seed 322 of level 2."""


@dataclass(frozen=True)
class Completion:
    """Silhouettes completed where clothes resemble the background (`silhouettes.completion`).

    Tuned on seeds 212, 322, 325 and 344 of level 2 by `benchmarks.completed`.
    """

    voxel_m: float = 0.03
    """m. Edge of the voxels of what is missing."""
    hole_share: float = 2e-3
    """1. Holes in what may belong to a silhouette are filled up to this share of the image."""
    piece_m3: float = 0.001
    """m³. Smaller pieces are noise: a forearm has a litre, a thigh eight."""
    piece_share: float = 0.6
    """1. Share of a piece's pixels that differ from the background, mean of the cameras."""
    camera_share: float = 0.4
    """1. The same of the camera that shows least of it."""
    most_added: float = 1.5
    """1. Of the hull's volume: a larger piece is no part of a person."""


@dataclass(frozen=True)
class FloorShadows:
    """Shadows on the floor (`silhouettes.floor_shadows`)."""

    longest_m: float = 3.0
    """m. Length of a shadow where no other camera sees the floor. By eye."""
    foot_m3: float = 0.0005
    """m³. Smallest piece of the hull by which the floor is found: a foot. By eye."""
    floor_m: float = 0.15
    """m. A floor no farther from the world's origin than this is there. By eye."""


@dataclass(frozen=True)
class Colours:
    """A second segmentation by the person's colours (`silhouettes.prepared_silhouettes`).

    Tuned on seeds 301 to 340 of level 2 and balancing4.
    """

    asked: float = 0.03
    """1. Share of the silhouettes' pixels that nothing explains, from which colours are asked: a
    turned camera leaves less."""
    asked_again: float = 0.01
    """1. The same, from which they are asked again."""
    most_left: float = 0.7
    """1. Largest share of that which may be left, or what was added is taken back."""


@dataclass(frozen=True)
class UpSearch:
    """Which way is up (`silhouettes.up_search`)."""

    sure: float = 0.75
    """1. Cameras' worth from which, on average, they stand upright. By eye."""
    clearly: float = 0.3
    """1. By which one direction must lie along the trunks more than another. By eye, on
    `benchmarks.turned`."""


PERSON_COST, PERSON_SEARCH = PersonCost(), PersonSearch()
HULL_GIRTH, SITTING_SEARCH = HullGirth(), SittingSearch()
STATIC_OBJECTS, CAMERA_REPAIR = StaticObjectSearch(), CameraRepair()
COMPLETION, FLOOR_SHADOWS, COLOURS, UP_SEARCH = Completion(), FloorShadows(), Colours(), UpSearch()
