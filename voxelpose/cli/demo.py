"""voxelpose demo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import arg

from calib.errors import InputError

_ALONE = "cam_2"  # sees the performance from the front


@dataclass(frozen=True)
class Demo:
    """The arguments of `voxelpose demo`."""

    help: ClassVar[
        str
    ] = """Makes a small recording, fits it and scores it: a first result without any data or network.

A mannequin that is shaped unlike the fitting model is filmed by four cameras, with shadow and noise.
OUT gets recording/ (what an own recording looks like), result/ (what a fit gives), track/ (the same from one camera) and their scores.
The first run compiles the fast code and makes a pose library, which takes most of its time.

  voxelpose demo --out demo
"""

    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made."""
    frames: Annotated[int, arg(metavar="N")] = 60
    """How many frames of the performance, at 20 per second; 60 are the whole."""
    track: bool = True
    """Estimate the motion from one camera alone as well; its first run makes a pose library, which
    takes a minute or two.
    """
    overwrite: bool = False
    """Replace an earlier demo in OUT."""
    threads: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None
    """Processor threads. Left out: all."""

    def run(self) -> int:
        """Makes, fits, scores."""
        from voxelpose.cli.progress import Progress
        from voxelpose.results import Result, ResultWriter, as_json

        if not 1 <= self.frames <= 600:
            raise InputError(f"--frames {self.frames} is impossible: give 1 to 600")
        with ResultWriter(self.out, self.overwrite) as folder, Progress() as progress:
            progress.note_compilation()
            progress.stage("making a recording")
            from dataclasses import asdict

            from silhouette_core.estimator import Settings
            from voxelpose import __version__
            from voxelpose.demo.filming import make_recording
            from voxelpose.evaluation import evaluate
            from voxelpose.fitting import Output, fit, track
            from voxelpose.recording.folder import Recording

            recording = Recording.open(make_recording(folder / "recording", self.frames))
            result = fit(
                recording,
                Output(folder / "result"),
                Settings(threads=self.threads),
                reporter=progress,
            )
            truth = folder / "recording" / "truth.json"
            score = evaluate(folder / "result", truth)
            if self.track:
                alone = Recording.open(folder / "recording", cameras=[_ALONE])
                track(alone, Output(folder / "track"), Settings(threads=self.threads), progress)
                (folder / "score_track.json").write_text(
                    as_json(asdict(evaluate(folder / "track", truth))), encoding="utf-8"
                )
            about = {"voxelpose": __version__, "demo": True, "seconds": result.summary["seconds"]}
            (folder / "summary.json").write_text(as_json(about), encoding="utf-8")
            (folder / "score.json").write_text(as_json(asdict(score)), encoding="utf-8")
        from voxelpose.cli.summary import print_result, print_score

        print_result(Result.open(self.out / "result"))
        print(f"\nagainst the truth in {self.out / 'recording' / 'truth.json'}:")
        print_score(score)
        if self.track:
            print(
                f"\nthe same from {_ALONE} alone, with the tree of silhouettes:"
                f" {self.out / 'track'}, scored in score_track.json"
            )
        print(
            f"\nyour own recording: a folder like {self.out / 'recording'}, then voxelpose fit"
            " FOLDER --out OUT --stature 1.75"
        )
        return 0
