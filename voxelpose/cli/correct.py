"""voxelpose correct."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli import arguments

if TYPE_CHECKING:
    from voxelpose.corrections import Correction


@dataclass(frozen=True)
class Correct:
    """Corrects a result by hand, beside the estimate, which stays as it is; without options lists.

      voxelpose correct walk_fit
      voxelpose correct walk_fit --trim 20:180
      voxelpose correct walk_fit --exchange-sides 40:60
      voxelpose correct dance_fit --exchange-sides 40:60 --person 2
      voxelpose correct dance_fit --exchange-people 1,2 --start 120
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
    person: Annotated[int | None, arguments.optional("N")] = None
    """Number of the person whose sides are exchanged, of several."""
    exchange_people: Annotated[str | None, arguments.optional("N,N")] = None
    """Exchange two people from the frame --start on."""
    start: Annotated[int | None, arguments.optional("N")] = None
    """First frame of --exchange-people."""
    undo: Annotated[str | None, arguments.optional("N|last|all")] = None
    """Take back a correction, by its number in the list, the last one, or all."""

    def run(self) -> None:
        """Makes the corrections and prints all that there are."""
        from voxelpose.corrections import read_corrections
        from voxelpose.results import correct, corrections_home, open_people

        home, number = corrections_home(self.result)
        if self.undo == "all":
            correct(home, [])
        results = open_people(self.result)
        made = [*read_corrections(home)]
        if self.undo not in (None, "all"):
            made.pop(self._undone(len(made)))
        motions = [result.motion for result in results]
        limits = (
            min(int(motion.frames[0]) for motion in motions),
            max(int(motion.frames[-1]) for motion in motions) + 1,
        )
        several = home != self.result or len(results) > 1
        if self.exchange_sides and len(results) > 1 and self.person is None:
            raise InputError("whose left and right? Give the number of a --person")
        added = self._added(limits, (self.person or number) if several else self.person)
        made += added
        if added or self.undo not in (None, "all"):
            correct(home, made)
        lines = [f"{k}  {correction}" for k, correction in enumerate(made, 1)]
        print("\n".join(lines or ["nothing is corrected"]))

    def _undone(self, count: int) -> int:
        """Index of the correction that is taken back."""
        text = str(count) if self.undo == "last" else str(self.undo)
        if not text.isdecimal() or not 1 <= int(text) <= count:
            known = f"a number from 1 to {count}, last or all" if count else "nothing is corrected"
            raise InputError(f"--undo {self.undo} names no correction: {known}")
        return int(text) - 1

    def _added(self, limits: tuple[int, int], person: int | None) -> list[Correction]:
        """The corrections that are asked for, of a result whose poses are within limits."""
        from voxelpose.corrections import ExchangePeople, ExchangeSides, Trim
        from voxelpose.recording.folder import frame_range

        def frames(text: str, setting: str) -> tuple[int, int]:
            asked = frame_range(text, setting) or limits
            first, stop = (limits[k] if given is None else given for k, given in enumerate(asked))
            return max(first, limits[0]), min(stop, limits[1])

        added: list[Correction] = []
        if self.trim is not None:
            added.append(Trim(frames(self.trim, "--trim {}")))
        if self.exchange_sides is not None:
            sides = frames(self.exchange_sides, "--exchange-sides {}")
            added.append(ExchangeSides(sides, person))
        if self.exchange_people is not None:
            if self.start is None:
                raise InputError("--exchange-people needs the frame --start from which on")
            one, other = arguments.two_numbers(
                self.exchange_people, "--exchange-people", "two numbers, as in 1,2", ","
            )
            added.append(ExchangePeople(max(self.start, 0), (one, other)))
        return added
