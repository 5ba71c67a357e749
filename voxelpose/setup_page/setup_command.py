"""voxelpose setup."""

from dataclasses import dataclass

from voxelpose.cli.arguments import Fps, Label, PageArguments, RecordingFolder, Unit
from voxelpose.cli.options import folder_settings
from voxelpose.cli.terminal import message


@dataclass(frozen=True)
class Setup(PageArguments):
    """Sets a recording up in the browser, before the first fit.

    Shows the pictures of all cameras side by side. Draw where the person may be and what furniture
    hides, click points of the scene, see the silhouettes, check the cameras, choose up. Nothing is
    written before Save. The page is served by this machine, and only to this machine unless --host
    is given; Ctrl-C ends it.

      voxelpose setup walk
      voxelpose setup walk --no-browser --port 9000
      voxelpose setup walk --host 0.0.0.0 --token "a long word"
    """

    recording: RecordingFolder
    unit: Unit = None
    fps: Fps = None
    label: Label = None

    def run(self) -> None:
        """Serves the page until it is interrupted."""
        address = self.address()
        from voxelpose.setup_page.opened_folder import OpenedFolder
        from voxelpose.setup_page.setup_session import SetupServer, SetupSession

        known = folder_settings("fit", self.recording)
        unit = self.unit or known.get("unit", (None, ""))[0]
        fps = self.fps or known.get("fps", (None, ""))[0]
        label = self.label or known.get("label", (None, ""))[0]
        session = SetupSession(OpenedFolder.open(self.recording, unit, fps, label))
        self.serve(message(str(self.recording)), SetupServer(session, address))
