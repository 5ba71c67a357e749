"""voxelpose report."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress


@dataclass(frozen=True)
class Report:
    """Writes report.html: the result's content, its quality, and advice.

    The report is one file that can be sent by mail; it loads nothing from elsewhere. An earlier
    report is replaced.

      voxelpose report walk_fit
      voxelpose report walk_fit --out walk.html
    """

    folder: Annotated[Positional[Path], arg(metavar="OUT")]
    """Folder of a result."""
    out: arguments.OptionalFile = None
    """File to be written. Default: report.html in the folder."""
    recording: Annotated[Path | None, arguments.optional("RECORDING")] = None
    """The recording, if it was moved after the fit."""
    overwrite: bool = False
    """Replace FILE even if it is not a report."""

    def run(self) -> None:
        """Writes the report."""
        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.report.page import write_report

            path = write_report(self.folder, self.out, self.recording, self.overwrite, progress)
        print(f"{path}: {path.stat().st_size / 2**20:.1f} MiB; open it in a browser")
