"""What is found in a result, a synchronisation or an installation, in one form."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Level = Literal["bad", "look", "good"]
_LEVELS: tuple[Level, ...] = ("bad", "look", "good")
_RANGES = 6  # listed one by one


@dataclass(frozen=True)
class Finding:
    """What is found of one aspect; as text a line, words and remedy."""

    about: str  # the aspect
    level: Level  # `bad` makes a result doubtful; `look`: to be looked at
    words: str  # what is found, without a full stop
    where: str = ""  # in which frames or joints
    remedy: str = ""  # what the user can do; empty where nothing needs to be done

    def __str__(self) -> str:
        return f"{self.words}: {self.remedy}" if self.remedy else self.words


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Findings by their levels, those of one level in the order in which they are given."""
    return sorted(findings, key=lambda finding: _LEVELS.index(finding.level))


def ranges_text(frames: NDArray[np.int64]) -> str:
    """Frame numbers (n,) in ascending order, as text: "frames 3–5, 9 and 4 more ranges"."""
    runs = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
    listed = [f"{run[0]}–{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:_RANGES]]
    more = f" and {len(runs) - _RANGES} more ranges" if len(runs) > _RANGES else ""
    return f"frame{'' if len(frames) == 1 else 's'} {', '.join(listed)}{more}"
