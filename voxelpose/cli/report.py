"""voxelpose report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg


@dataclass(frozen=True)
class Report:
    """The arguments of `voxelpose report`."""

    help: ClassVar[
        str
    ] = """Writes report.html into a result: what was found, how well, and what to do about the rest.

One page that can be sent by mail: it holds everything it shows, and loads nothing.
An earlier report is replaced.

  voxelpose report walk_fit
  voxelpose report walk_fit --out walk.html
"""

    folder: Annotated[Positional[Path], arg(metavar="OUT")]
    """Folder of a fit."""
    out: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Where the page goes. Left out: report.html in the folder."""
    recording: Annotated[Path | None, arg(metavar="RECORDING", help_behavior_hint="")] = None
    """The recording, if it has moved since the fit."""
    overwrite: bool = False
    """Replace FILE even if it is something else than a report."""

    def run(self) -> int:
        """Writes."""
        from voxelpose.cli.progress import Progress

        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.report.page import ReportSettings, write_report

            path = write_report(
                self.folder, ReportSettings(self.out, self.recording, self.overwrite), progress
            )
        print(f"{path}: {path.stat().st_size / 2**20:.1f} MiB; open it in a browser")
        return 0
