"""The proposal that comes with the program is small, whole, and made as the code makes it."""

import tomllib
from pathlib import Path

import numpy as np

from benchmarks.library_fuzz_targets import unlearned_proposal
from silhouette_core.monocular.proposal import shipped
from tools import proposal as maker


def test_weights_come_back_rounded(tmp_path):
    made = unlearned_proposal()
    shipped.write_proposal(made, tmp_path / "one.safetensors")
    read = shipped.read_proposal(tmp_path / "one.safetensors").arrays()
    for name, array in made.arrays().items():
        assert read[name].dtype == array.dtype
        step = np.abs(array).max(axis=0) / 127 if "weight" in name else 0
        assert (np.abs(read[name] - array) <= 0.51 * step).all()


def test_it_is_small_and_states_how_it_was_made():
    assert shipped.FILE.stat().st_size <= 6_000_000
    card = tomllib.loads(shipped.CARD.read_text(encoding="utf-8"))
    assert card["recipe_sha256"] == maker.recipe(), "run python -m tools.proposal: it is stale"
    assert len(card["clips"]) > 50 and not set(card["clips"]) & set(card["left_out"])
    assert not any(Path(clip).suffix for clip in card["clips"])  # names, not files
    assert shipped.shipped_proposal().network.modes == maker.SETTINGS.training.modes
