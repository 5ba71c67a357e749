"""voxelpose demo."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from tyro.conf import arg

from calib.storage.atomic import write_whole
from voxelpose.cli.arguments import Threads
from voxelpose.cli.terminal import Progress

_TRACKED = "cam_2"  # sees the performance from the front


@dataclass(frozen=True)
class Demo:
    """Renders a small recording, fits it and scores the result.

    No data and no network are needed. The recording shows a mannequin, whose shape differs from the
    fitted model, from four cameras, with shadow and noise. OUT receives recording/ (an example of a
    recording folder), result/ (from all cameras), track/ (from one camera) and their scores. The
    first run compiles the program, which takes most of its time. With --live a recording is played
    instead, again and again, as if cameras filmed it: the page in the browser shows what `voxelpose
    live` finds.

      voxelpose demo --out demo
      voxelpose demo --out demo --live
    """

    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made."""
    frames: Annotated[int, Meta(ge=1, le=600), arg(metavar="N")] = 60
    """Number of frames, at 20 per second; the performance repeats after 60."""
    track: bool = True
    """Estimate the motion from one camera as well, once that from four is shown."""
    live: bool = False
    """Show live estimation, with a recording of six seconds, made once in OUT/live, as cameras."""
    browser: bool = True
    """Open the page of --live; --no-browser only prints its address."""
    overwrite: bool = False
    """Replace an earlier demo in OUT."""
    threads: Threads = None

    def run(self) -> None:
        """Renders, fits and scores the recording."""
        from voxelpose.results import Result, ResultWriter, as_json

        if self.live:
            self._run_live()
            return
        with ResultWriter(self.out, self.overwrite) as folder, Progress() as progress:
            progress.note_compilation("multiview", *(["monocular"] if self.track else []))
            progress.stage("making a recording")
            from silhouette_core.estimator import Settings
            from voxelpose.demo.room import make_recording
            from voxelpose.evaluation import evaluate
            from voxelpose.fitting import Output, fit, track
            from voxelpose.recording.folder import Recording
            from voxelpose.recording.truth import TRUTH
            from voxelpose.version import __version__

            settings = Settings(threads=self.threads)
            recording = Recording.open(make_recording(folder / "recording", self.frames))
            result = fit(recording, Output(folder / "result"), settings, reporter=progress)
            truth = folder / "recording" / TRUTH
            score = evaluate(folder / "result", truth)
            summary = {"voxelpose": __version__, "demo": True, "seconds": result.summary["seconds"]}
            (folder / "summary.json").write_text(as_json(summary), encoding="utf-8")
            (folder / "score.json").write_text(as_json(asdict(score)), encoding="utf-8")
        from voxelpose.cli.summary import print_result, print_score

        print_result(Result.open(self.out / "result"))
        print(f"\nagainst the truth in {self.out / 'recording' / TRUTH}:")
        print_score(score)
        if self.track:
            print(f"\nnow from {_TRACKED} alone:", flush=True)
            with Progress() as progress:
                one_camera = Recording.open(self.out / "recording", cameras=[_TRACKED])
                track(one_camera, Output(self.out / "track"), settings, progress)
                score = evaluate(self.out / "track", self.out / "recording" / TRUTH)
            write_whole(self.out / "score_track.json", as_json(asdict(score)).encode())
            print_result(Result.open(self.out / "track"))
            print_score(score)
        print(
            f"\nfor your own recording, make a folder like {self.out / 'recording'}, then run:"
            " voxelpose fit FOLDER --out OUT --stature 1.75"
        )

    def _run_live(self) -> None:
        """Plays the recording to the live estimation until Ctrl-C."""
        from voxelpose.cli.live import Live
        from voxelpose.results import ResultWriter, as_json, is_result
        from voxelpose.version import __version__

        out = self.out / "live"
        if self.overwrite or not is_result(out):
            with ResultWriter(out, self.overwrite) as folder, Progress() as progress:
                progress.stage("making a recording")
                from voxelpose.demo.room import make_recording

                make_recording(folder / "recording", performance="there_and_back")
                summary = {"voxelpose": __version__, "demo": True}
                (folder / "summary.json").write_text(as_json(summary), encoding="utf-8")
        Live(folder=out / "recording", loop=True, browser=self.browser).run()
