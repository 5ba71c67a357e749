"""An option that is added to a command's class is there wherever options are."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import pytest
from msgspec import Meta

from calib.errors import InputError
from tests.sources import ring, write_recording
from voxelpose.batch.jobs import jobs_of
from voxelpose.cli import _parse, fit, run
from voxelpose.cli.options import folder_settings
from voxelpose.recording.folder import Recording
from voxelpose.result_documents import settings_document
from voxelpose.studio.command_forms import filled_in, form_of
from voxelpose.studio.projects import StudioFolder


@dataclass(frozen=True, kw_only=True)
class WiderFit(fit.Fit):
    """As `fit`, with an option more."""

    estimator_options: ClassVar = fit.Fit.estimator_options | {"patience_s": "patience"}
    patience: Annotated[float, Meta(ge=0.5, le=60)] = 1.0
    """Seconds that the estimator waits."""


@pytest.fixture
def walk(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(fit, "Fit", WiderFit)
    return write_recording(tmp_path / "walk", ring(2))


def test_it_is_an_argument_and_a_setting_of_files(walk, capsys):
    assert _parse("fit", [str(walk), "--out", "x", "--patience", "3"]).patience == 3
    assert run(["fit", str(walk), "--out", "x", "--patience", "61"]) == 2
    line = "--patience = '61.0' must be a number from 0.5 to 60"
    assert line in capsys.readouterr().err
    (walk / "voxelpose.toml").write_text("[fit]\npatience = 4\n")
    assert folder_settings("fit", walk)["patience"].value == 4
    assert run(["settings", str(walk)]) == 0
    assert any(
        line.split()[:2] == ["patience", "4.0"] for line in capsys.readouterr().out.split("\n")
    )


def test_it_is_a_setting_of_a_batch(walk):
    (job,) = jobs_of([walk], "fit", {"patience": 5})
    assert job.estimation().settings().options == {"patience_s": 5.0}
    for value in ("long", 61):
        with pytest.raises(InputError, match=f"patience = '{value}' must be a number from 0.5 to"):
            jobs_of([walk], "fit", {"patience": value})


def test_it_is_in_the_form_of_the_studio(walk):
    (row,) = [row for row in form_of("fit", walk) if row["name"] == "patience"]
    assert row["help"] == "Seconds that the estimator waits."
    assert (row["input"], row["usual"], row["group"]) == ("number", 1.0, "expert")
    assert (row["least"], row["most"]) == (0.5, 60)
    fixed = {"recording": walk, "out": walk / "x"}
    command = filled_in("fit", StudioFolder(walk.parent), walk, fixed, {"patience": 6})
    assert command.patience == 6


def test_it_is_in_the_settings_of_the_result(walk):
    command = WiderFit(recording=walk, out=walk / "x", patience=7)
    document = settings_document(Recording.open(walk), walk, command.settings(), "multiview")
    assert document["options"] == {"patience_s": 7}
