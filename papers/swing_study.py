"""The arm-swing experiment of paper A, from drawn people to its table and pictures."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.tailoring import person_of
from papers.arm_swing import METHODS, Case, MotionModel, Row, track_arm
from papers.swing_film import (
    FACING_DEG,
    FPS,
    PITCH_DEG,
    SWINGS,
    SwingFilm,
    drawn_person,
    drawn_swings,
    film,
)
from papers.swing_library import SAMPLES, arm_motions, swing_library
from papers.swing_report import draw_angles, draw_costs, swing_table
from papers.swings import Criterion
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.progress import Reporter
from voxelpose.demo.choreography import Performance
from voxelpose.results import SUMMARY, as_json
from voxelpose.version import __version__

TABLE, ANGLES, COSTS = "table.md", "angles.png", "costs.png"
STATURE_M = 1.70
"""Of the library's body; the people's builds are their own."""
_OTHER_SEEDS, _OTHER_SWINGS = (101, 102), 4  # by which sigma is found
WEIGHTINGS = ("wxor", "nwxor")
MODELS: tuple[MotionModel, ...] = ("density", "normalised", "kernel")
SIGMAS = (0.01, 0.02, 0.04, 0.08)


@dataclass(frozen=True)
class Study:
    """Settings of the experiment.

    Attributes:
        seeds: a person and a film each, for either side.
        swings: of each film.
        samples: of each library, at most.
        wide: whether all people have thin arms and wide trunks.
        sigmas: deviations of (10) among which every row has the one that suits it.
    """

    seeds: Sequence[int] = (1, 2, 3, 4, 5)
    swings: int = SWINGS
    samples: int = SAMPLES
    wide: bool = False
    sigmas: Sequence[float] = SIGMAS


@dataclass(eq=False)
class Side:
    """Results of the arm on one side.

    Attributes:
        near: whether it is toward the camera.
        nodes: numbers of nodes of the trees, by weighting.
        films: one a seed.
        rows: for every case one a film.
    """

    near: bool
    nodes: dict[str, list[int]] = field(default_factory=dict)
    films: list[SwingFilm] = field(default_factory=list)
    rows: list[list[Row]] = field(default_factory=list)


def drawn_film(study: Study, seed: int, near: bool, reporter: Reporter) -> SwingFilm:
    """Film of a seed: another person and other swings on either side."""
    rng = np.random.default_rng((seed, near))
    person, played = drawn_person(rng, study.wide), drawn_swings(rng, near, study.swings)
    reporter.stage(f"{'near' if near else 'far'} arm, film {seed}", played.frames)
    return film(person, played, rng, reporter)


def run_study(study: Study, folder: Path, reporter: Reporter) -> list[Side]:
    """Runs the experiment and writes table.md, angles.png, costs.png and summary.json.

    Args:
        study: see Study.
        folder: where the files go.
        reporter: notified of every stage.
    """
    body, sides = BodyModel.from_sizes(BodySizes(STATURE_M)), []
    motions = arm_motions(body)
    other = replace(study, swings=_OTHER_SWINGS)
    for near in (False, True):
        side = Side(near)
        libraries = {
            one: swing_library(motions, near, PITCH_DEG, one, reporter, study.samples)
            for one in WEIGHTINGS
        }
        others = [drawn_film(other, k, near, reporter) for k in _OTHER_SEEDS]
        side.nodes = {one: [len(level) for level in libraries[one].levels] for one in libraries}
        side.films = [drawn_film(study, k, near, reporter) for k in study.seeds]
        for name, library in libraries.items():
            reporter.stage(f"{name}, {'near' if near else 'far'} arm")
            side.rows += tracked(library, study.sigmas, others, side.films)
        sides.append(side)
        if not near:
            draw_costs(posing(body, reporter), libraries, folder / COSTS)
            draw_angles([rows[0] for rows in side.rows], side.films[0], FPS, folder / ANGLES)
    (folder / TABLE).write_text(swing_table(sides), encoding="utf-8")
    (folder / SUMMARY).write_text(as_json(_summary(study, sides)), encoding="utf-8")
    return sides


def posing(body: BodyModel, reporter: Reporter) -> dict[str, SwingFilm]:
    """Single pictures of the far arm forth and back, of somebody built as the library's body, and
    of somebody with a narrow chest, thus thin arms, and a wide trunk.
    """
    alike, yaw_deg = person_of(body), FACING_DEG - 90.0
    wide = replace(
        alike,
        chest_girth_m=0.85 * alike.chest_girth_m,
        waist_girth_m=1.3 * alike.waist_girth_m,
        hip_girth_m=1.15 * alike.hip_girth_m,
    )
    films = {}
    for name, person in (("library's build", alike), ("thin arm, wide trunk", wide)):
        for way, arm_deg in (("forth", 60.0), ("back", -40.0)):
            keys = np.array([[0.0, yaw_deg, arm_deg, 15.0], [1 / FPS, yaw_deg, arm_deg, 15.0]])
            played = Performance("yaw r_arm r_elbow", keys, FPS, interpolation="linear")
            films[f"{name}, {way}"] = film(person, played, np.random.default_rng(0), reporter)
    return films


def tracked(
    library: PoseLibrary,
    sigmas: Sequence[float],
    others: Sequence[SwingFilm],
    films: Sequence[SwingFilm],
) -> list[list[Row]]:
    """Results on some films with a library's distance: for every method of this distance and
    reading of (4) a row a film, with that deviation of (10) of some that errs least in other films.
    The paper found it by experiment, too.
    """
    cases = [
        Case(method, model, sigma)
        for method, model, sigma in product(METHODS, MODELS, sigmas)
        if method.weighting == library.settings.weighting
        and (method.occlusion_aware or model != "kernel")  # with DM1 that is the density
    ]
    tried = [[row.error_deg for row in track_arm(one, library, cases)] for one in others]
    best = np.sum(tried, axis=0).reshape(-1, len(sigmas)).argmin(axis=1)
    chosen = [cases[len(sigmas) * row + k] for row, k in enumerate(best)]
    by_film = [track_arm(one, library, chosen) for one in films]
    return [list(rows) for rows in zip(*by_film, strict=True)]


def _summary(study: Study, sides: Sequence[Side]) -> dict[str, object]:
    return {
        "voxelpose": __version__,
        "study": asdict(study),
        "criterion": asdict(Criterion()),
        "sides": [
            {
                "right_arm": "near" if side.near else "far",
                "nodes": side.nodes,
                "rows": [
                    [
                        {"case": str(row.case), **row.counts, "error_deg": row.error_deg}
                        for row in rows
                    ]
                    for rows in side.rows
                ],
            }
            for side in sides
        ],
    }
