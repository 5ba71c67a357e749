"""What a live session prints: its state while it runs, and its durations at the end."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

from voxelpose.cli.terminal import plain, rich_console

if TYPE_CHECKING:
    from rich.status import Status

    from voxelpose.live.live_frame import SessionState
    from voxelpose.live.session import LiveSession


class StateLine:
    """State of a session: one changing line on a terminal, a line per change elsewhere."""

    def __init__(self) -> None:
        """Prints nothing yet."""
        self._line: Status | None = None
        self._said: tuple[str, ...] = ()
        if sys.stderr.isatty():
            self._line = rich_console(stderr=True).status("")
            self._line.start()

    def show(self, state: SessionState) -> None:
        """Shows the present state."""
        wrong = tuple(f"{name}: {said}" for name, said in state.cameras.items() if said != "ok")
        if self._line is not None:
            numbers = f"{state.fps:.0f} frames a second, {state.dropped} dropped"
            if np.isfinite(state.latency_s):
                numbers += f", {1000 * state.latency_s:.0f} ms from picture to pose"
            self._line.update(plain("; ".join([state.message, numbers, *wrong])))
            return
        # Seconds that count down are no news.
        message = state.message.partition(":")[0] if state.phase == "countdown" else state.message
        if (message, *wrong) != self._said:
            self._said = (message, *wrong)
            print("; ".join(self._said), file=sys.stderr, flush=True)

    def close(self) -> None:
        """Removes the changing line."""
        if self._line is not None:
            self._line.stop()


def print_session(session: LiveSession) -> None:
    """Prints frames, dropped frames and the durations of the stages of a session."""
    from rich.table import Table

    console, state = rich_console(), session.state
    table = Table("stage", "min ms", "max ms", "mean ms", "median ms", "95 % ms", "99 % ms")
    table.box, table.padding = None, (0, 2, 0, 0)
    for name, spent in session.times.summary().items():
        values = spent.least, spent.most, spent.mean, spent.median, spent.p95, spent.p99
        table.add_row(name, *(f"{1000 * value:.1f}" for value in values))
    if table.row_count:
        console.print(table)
    console.print(f"{state.frames} frames estimated, {state.dropped} dropped")
