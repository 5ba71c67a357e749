"""voxelpose evaluate."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli import arguments

if TYPE_CHECKING:
    from voxelpose.evaluation import Score
    from voxelpose.scan_distance import ScanScore

_TRUTH_FILES = (".json", ".trc", ".safetensors")  # a joints.csv may be a result


@dataclass(frozen=True)
class Evaluate:
    """Scores results against known joint positions, or against a scan of the body.

    The known positions (the truth) are a TRC or a truth.json with the 15 joints of joints.csv, in
    world coordinates, one position per frame: {"unit": "m", "joints": {"pelvis": [[x, y, z], ...],
    ...}}. The file may also be the last argument. Default: truth.json in the folder of the
    recording.

    Of several people (a folder with person_1 and so on) truth.json has `people`, a list of tables
    with `joints` each; who is who is found by the positions.

    Of any body, a robot's or an animal's, the truth is its motion (.safetensors), which knows the
    joint angles too, or a joints.csv with the body's own names. Default: truth.safetensors of the
    recording.

    With --scan the body's surface in one frame, and the carved hull, are compared with a closed
    mesh of the person, taken in that pose, in the world of the recording's calibration. Mean
    (signed: above 0 is outside), RMS, 95 % and worst distance are printed, mm. Joints are scored
    as well where --truth is given.

      voxelpose evaluate walk_fit --truth walk/truth.json
      voxelpose evaluate walk_fit --truth pose2sim.trc --markers head_top=Head
      voxelpose evaluate robot_fit --truth robot/truth.safetensors
      voxelpose evaluate fits/* --markdown > table.md
      voxelpose evaluate dance_fit
      voxelpose evaluate walk_fit --scan body.ply --frame 40
      voxelpose evaluate walk_fit --scan scanner.stl --unit mm --align
    """

    results: Annotated[
        Positional[tuple[Path, ...]], arg(metavar="RESULT", help_behavior_hint="(required)")
    ]
    """Folder of a result, or a joints.csv; several results are printed as a table."""
    truth: Annotated[tuple[Path, ...], arguments.optional("FILE")] = ()
    """File of the known positions: one for all results, or one for each."""
    offset: Annotated[int, arg(metavar="FRAMES")] = 0
    """Number added to the result's frame numbers before the comparison."""
    markers: Annotated[str | None, arguments.optional("JOINT=NAME,...")] = None
    """Markers of a TRC by joint, where their names are not recognised."""
    axes: Annotated[str, arg(metavar="AXES")] = "yzx"
    """World axes to which x, y and z of a TRC correspond; yzx for Pose2Sim and voxelpose."""
    scan: arguments.OptionalFile = None
    """Closed mesh of the person, PLY, STL, OBJ or DAE, with which the result is compared."""
    frame: Annotated[int | None, arguments.optional("N")] = None
    """Number of the frame in which the pose is the scan's. Default: the first with a pose."""
    unit: Literal["m", "cm", "mm"] = "m"
    """Unit of the scan's lengths."""
    align: bool = False
    """Move the scan, which may be in any upright frame, onto the body first (ICP)."""
    recording: Annotated[Path | None, arguments.optional("RECORDING")] = None
    """The recording, from which the hull of --scan is carved, if it was moved after the fit."""
    markdown: bool = False
    """Print a Markdown table, as for several results."""
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> None:
        """Prints the scores."""
        from voxelpose.evaluation import evaluate, evaluate_people, markdown_table
        from voxelpose.results import as_json, holds_people

        scanned = self._scan_score()
        if scanned is not None and not self.truth:
            if self.json:
                print(as_json({"scan": asdict(scanned)}), end="")
            return
        results, truths = _results_and_truths(self.results, self.truth)
        markers = _markers(self.markers)
        scores: dict[str, Score] = {}
        names, each_truth = _names(results), truths or [None] * len(results)
        for name, result, truth in zip(names, results, each_truth, strict=True):
            if holds_people(result):
                people = evaluate_people(result, truth, self.offset)
                scores |= {f"{name}/{person}": score for person, score in people.items()}
            else:
                scores[name] = evaluate(result, truth, self.offset, markers, self.axes)
        if self.json:
            documents = {name: _document(score) for name, score in scores.items()}
            document = documents if len(scores) > 1 else documents.popitem()[1]
            if scanned is not None:
                document["scan"] = asdict(scanned)
            print(as_json(document), end="")
        elif self.markdown or len(scores) > 1:
            print(markdown_table(scores), end="")
        else:
            from voxelpose.cli.summary import print_score

            print_score(*scores.values())

    def _scan_score(self) -> ScanScore | None:
        """The comparison with the scan, printed unless as JSON; None where there is no scan."""
        if self.scan is None:
            if (self.frame, self.unit, self.align, self.recording) != (None, "m", False, None):
                raise InputError(
                    "--frame, --unit, --align and --recording are of a scan: name it with --scan"
                )
            return None
        if len(self.results) != 1:
            raise InputError(f"--scan compares one result, not {len(self.results)}: name one")
        from voxelpose.scan_distance import evaluate_scan

        score = evaluate_scan(
            self.results[0], self.scan, self.frame, self.unit, self.align, self.recording
        )
        if not self.json:
            from voxelpose.cli.summary import print_scan_score

            print_scan_score(score)
        return score


def _results_and_truths(
    paths: tuple[Path, ...], truths: tuple[Path, ...]
) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Returns the results and their truths; no truth, or as many as there are results."""
    if not truths and len(paths) > 1 and paths[-1].suffix.lower() in _TRUTH_FILES:
        paths, truths = paths[:-1], paths[-1:]
    if not paths:
        raise InputError("no result is named: give the folder of a fit")
    if len(truths) not in (0, 1, len(paths)):
        raise InputError(
            f"there are {len(paths)} results and {len(truths)} truths: give one truth for all, or"
            " one for each"
        )
    return paths, truths * len(paths) if len(truths) == 1 else truths


def _names(results: tuple[Path, ...]) -> list[str]:
    """Returns names of the results: those of their folders, or whole paths where not unique."""
    short = [result.resolve().name for result in results]
    return short if len(set(short)) == len(short) else [str(result) for result in results]


def _markers(text: str | None) -> dict[str, str]:
    from silhouette_core.body.joints import LANDMARK_NAMES

    pairs = [pair.partition("=") for pair in (text or "").split(",") if pair.strip()]
    markers = {joint.strip(): name.strip() for joint, _, name in pairs}
    for joint, name in markers.items():
        if joint not in LANDMARK_NAMES or not name:
            raise InputError(
                f"--markers {text} is not understood: give JOINT=NAME, the joints being"
                f" {', '.join(LANDMARK_NAMES)}"
            )
    return markers


def _document(score: Score) -> dict[str, object]:
    document = asdict(score)
    joints = document.pop("joints")
    return {**document, "joint_root_mm": dict(zip(joints, score.joint_root_mm, strict=False))}
