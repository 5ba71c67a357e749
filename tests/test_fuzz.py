"""Damaged files of every format end in success or in one line: a few of `make fuzz`."""

import re
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
_SLOW = ("summary", "settings")
_MUTATIONS, _MOST_S, _SEED = 300, 0.2, 7


@pytest.fixture
def fuzz(beside):
    return beside("fuzz")


def target_names() -> list[str]:
    """Names in the table of targets, without importing what they need."""
    path = ROOT / "benchmarks" / "fuzz_targets.py"
    if not path.exists():
        return []
    table = path.read_text(encoding="utf-8").partition("TARGETS: dict")[2]
    names = re.findall(r'^    "([a-z-]+)":', table, re.MULTILINE)
    loops = re.findall(
        r'(?:f"([a-z-]+)\{name\}"|\bname): .*?for name in \((.*?)\)', table, re.DOTALL
    )
    return names + [
        f"{start}{name}" for start, several in loops for name in re.findall(r"[a-z]+", several)
    ]


def test_every_target_is_tried(fuzz):
    assert sorted(target_names()) == sorted(fuzz.TARGETS)


@pytest.mark.filterwarnings("ignore::UserWarning:PIL")
@pytest.mark.parametrize(
    "name",
    [
        # The parts of a report take seconds to load.
        pytest.param(name, marks=pytest.mark.slow) if name in _SLOW else name
        for name in target_names()
    ],
)
def test_damaged_files_end_in_one_line(fuzz, tmp_path, name):
    bench = fuzz.Bench(name, tmp_path, _SEED)
    until_s = time.monotonic() + _MOST_S
    for number in range(_MUTATIONS):
        # The commands themselves, one in a hundred, are left to `make fuzz`.
        if number % 100 == 99 or time.monotonic() > until_s:
            continue
        word = bench.run(number)
        # Kernels are compiled in the first runs.
        if word.get("failure", "").startswith("over"):
            word = bench.run(number)
        again = f"python -m benchmarks.fuzz {name} --seed {_SEED} --only {number}"
        assert "failure" not in word, f"{word['failure']}: {again}"


def test_a_process_that_dies_or_is_silent_names_its_mutation(fuzz, monkeypatch):
    script = (
        "import json, os, signal, sys, time\n"
        "for number in range(int(sys.argv[1]), int(sys.argv[2])):\n"
        "    print(json.dumps({'begun': number}), flush=True)\n"
        "    if number == 2: os.kill(os.getpid(), signal.SIGSEGV)\n"
        "    if number == 4: time.sleep(60)\n"
        "    word = {'number': number, 'seconds': 0.1, 'refused': number % 2}\n"
        "    print(json.dumps(word | ({'failure': 'ValueError in a'} if number == 5 else {})))\n"
    )
    monkeypatch.setattr(
        fuzz, "_worker", lambda name, seed, *ends: [sys.executable, "-c", script, *map(str, ends)]
    )
    monkeypatch.setattr(fuzz, "_SILENT_S", 2.0)
    tally = fuzz.fuzz("any", 8, 0)
    assert tally.mutations == 8 and tally.failed == 3
    failures = {"the process ended: SIGSEGV": [2], "hangs": [4], "ValueError in a": [5]}
    assert tally.failures == failures
    assert "| any | 8 | 4 | 3 | 0.10 |" in fuzz.table({"any": tally})


def test_mutations_are_the_same_again_and_an_unknown_target_is_named(fuzz, tmp_path, capsys):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first, second = (fuzz.Bench("points", tmp_path / name, 3) for name in "ab")
    for number in range(20):
        first.write(number)
        second.write(number)
        a, b = ((tmp_path / name / "points.csv").read_bytes() for name in "ab")
        assert a == b
    assert fuzz.main(["nothing"]) == 2
    assert "no target nothing; there are calibration-toml" in capsys.readouterr().err
    assert fuzz.main(["points", "--only", "3", "--keep", str(tmp_path / "kept")]) == 0
    assert "mutated: points.csv" in capsys.readouterr().out
    assert (tmp_path / "kept" / "points.csv").exists()
