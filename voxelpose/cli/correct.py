"""voxelpose correct."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from calib.errors import InputError
from silhouette_core.setting_types import Limbs
from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress

if TYPE_CHECKING:
    from silhouette_core.progress import Reporter
    from voxelpose.corrections import Correction
    from voxelpose.results import Result


@dataclass(frozen=True)
class Correct:
    """Corrects a result by hand, beside the estimate, which stays as it is; without options lists.

      voxelpose correct walk_fit
      voxelpose correct walk_fit --trim 20:180
      voxelpose correct walk_fit --exchange-sides 40:60
      voxelpose correct walk_fit --exchange-sides 40:60 --limbs legs
      voxelpose correct dance_fit --exchange-sides 40:60 --person 2
      voxelpose correct dance_fit --exchange-people 1,2 --start 120
      voxelpose correct walk_fit --fit-again 60:90 --without cam_2
      voxelpose correct walk_fit --set-joints "left_wrist 75 0.42 -0.18 1.31"
      voxelpose correct walk_fit --undo last

    Whatever reads the result then has the corrected motion and names the corrections: view, export,
    report, evaluate. joints.csv, motion.bvh, motion.safetensors and pictures that the fit wrote are
    those of the estimate; export writes corrected ones. Of corrected frames nothing says how good
    they are: more of them than may be lost make a result doubtful.
    """

    result: Annotated[Positional[Path], arg(metavar="RESULT")]
    """Folder of a result, of one person or of several."""
    trim: Annotated[str | None, arguments.optional("A:B")] = None
    """Leave these frames only, of everybody: the first, and one past the last."""
    exchange_sides: Annotated[str | None, arguments.optional("A:B")] = None
    """Exchange left and right in these frames: the body is turned half round, and every limb put
    where that of the other side was, as far as its joints allow."""
    limbs: Annotated[Limbs | None, arguments.optional("arms|legs")] = None
    """Limbs whose sides alone are exchanged, while the trunk stays."""
    person: Annotated[int | None, arguments.optional("N")] = None
    """Number of the person whose sides are exchanged, of several."""
    exchange_people: Annotated[str | None, arguments.optional("N,N")] = None
    """Exchange two people from the frame --start on."""
    start: Annotated[int | None, arguments.optional("N")] = None
    """First frame of --exchange-people."""
    fit_again: Annotated[str | None, arguments.optional("A:B")] = None
    """Fit these frames again, of one person and with the same body, without a camera."""
    without: arguments.OptionalName = None
    """Name of the camera that --fit-again leaves out."""
    set_joints: Annotated[str | None, arguments.optional("TEXT")] = None
    """Joints that are set in frames, with commas between them: name as in joints.csv, frame, place
    in metres. About a second to either side is fitted again with them there."""
    undo: Annotated[str | None, arguments.optional("N|last|all")] = None
    """Take back a correction, by its number in the list, the last one, or all."""

    def run(self) -> None:
        """Makes the corrections and prints all that there are."""
        with Progress() as progress:
            made = self.correct(progress)
        lines = [f"{k}  {correction}" for k, correction in enumerate(made, 1)]
        print("\n".join(lines or ["nothing is corrected"]))

    def correct(self, reporter: Reporter) -> list[Correction]:
        """Makes the corrections; returns all that there are."""
        from voxelpose.results import correct, corrections_home, open_people

        home, number = corrections_home(self.result)
        if self.undo == "all":
            correct(home, [])
        results = open_people(self.result)
        motions = [result.motion for result in results]
        limits = (
            min(int(motion.frames[0]) for motion in motions),
            max(int(motion.frames[-1]) for motion in motions) + 1,
        )
        several = home != self.result or len(results) > 1
        if self.exchange_sides and len(results) > 1 and self.person is None:
            raise InputError("whose left and right? Give the number of a --person")
        added = self._added(limits, (self.person or number) if several else self.person)
        if self.fit_again is not None or self.set_joints is not None:
            if several:
                raise InputError(
                    "of several people no range can be fitted again: fit all frames again"
                )
            added += self._fitted_again(results[0], self._left(home), limits, reporter)
        made = self._left(home) + added  # a fit takes long: others may have been made meanwhile
        if added or self.undo not in (None, "all"):
            correct(home, made)
        return made

    def _left(self, home: Path) -> list[Correction]:
        """Corrections so far, without that which is taken back."""
        from voxelpose.corrections import read_corrections

        made = [*read_corrections(home)]
        if self.undo in (None, "all"):
            return made
        text = str(len(made)) if self.undo == "last" else str(self.undo)
        if not text.isdecimal() or not 1 <= int(text) <= len(made):
            known = f"a number from 1 to {len(made)}, last or all"
            reason = known if made else "nothing is corrected"
            raise InputError(f"--undo {self.undo} names no correction: {reason}")
        del made[int(text) - 1]
        return made

    def _added(self, limits: tuple[int, int], person: int | None) -> list[Correction]:
        """The corrections that are asked for, of a result whose poses are within limits."""
        from voxelpose.corrections import ExchangePeople, ExchangeSides, Trim

        added: list[Correction] = []
        if self.trim is not None:
            added.append(Trim(_frames(self.trim, "--trim {}", limits)))
        if self.exchange_sides is not None:
            sides = _frames(self.exchange_sides, "--exchange-sides {}", limits)
            added.append(ExchangeSides(sides, person, self.limbs))
        if self.exchange_people is not None:
            if self.start is None:
                raise InputError("--exchange-people needs the frame --start from which on")
            one, other = arguments.two_numbers(
                self.exchange_people, "--exchange-people", "two numbers, as in 1,2", ","
            )
            added.append(ExchangePeople(max(self.start, 0), (one, other)))
        return added

    def _fitted_again(
        self, result: Result, made: list[Correction], limits: tuple[int, int], reporter: Reporter
    ) -> list[Correction]:
        """Corrections by ranges that are fitted again, of one person."""
        from voxelpose.range_fit import fit_with_targets, fit_without, targets_told

        added: list[Correction] = []
        if self.fit_again is not None:
            if self.without is None:
                raise InputError("--fit-again needs the name of the camera that it is --without")
            frames = _frames(self.fit_again, "--fit-again {}", limits)
            added.append(fit_without(result, self.without, frames, made, reporter))
        if self.set_joints is not None:
            targets = targets_told(self.set_joints, "--set-joints {}")
            added.append(fit_with_targets(result, targets, [*made, *added], reporter))
        return added


def _frames(text: str | None, setting: str, limits: tuple[int, int]) -> tuple[int, int]:
    """A range within limits, whose ends may be left out."""
    from voxelpose.recording.folder import frame_range

    asked = frame_range(text, setting) or limits
    first, stop = (limits[k] if given is None else given for k, given in enumerate(asked))
    return max(first, limits[0]), min(stop, limits[1])
