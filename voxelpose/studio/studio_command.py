"""voxelpose studio."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from voxelpose.cli.arguments import PageArguments
from voxelpose.cli.terminal import message


@dataclass(frozen=True)
class Studio(PageArguments):
    """Goes from recorded files to exported motion in the browser, step by step.

    FOLDER holds recordings, a folder each, and receives their results; nothing outside of it is
    read or written. The page makes new recordings of files that you choose, checks and fits them,
    shows the results and exports them. The page is served by this machine, and only to this machine
    unless --host is given; Ctrl-C ends it.

      voxelpose studio
      voxelpose studio takes --no-browser --port 9000
      voxelpose studio takes --host 0.0.0.0 --token "a long word"
    """

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")] = Path()
    """Folder of the recordings and results. Default: the current folder."""

    def run(self) -> None:
        """Serves the page until it is interrupted."""
        address = self.address()
        from voxelpose.studio.projects import StudioFolder
        from voxelpose.studio.studio_server import StudioServer
        from voxelpose.studio.studio_session import StudioSession

        folder = StudioFolder(self.folder)
        server = StudioServer(StudioSession(folder), address)
        self.serve(message(str(folder.root)), server)
