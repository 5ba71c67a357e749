import errno
import time
from pathlib import Path

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.image.silhouettes import Silhouettes
from tests.sources import ring, write_staged
from tests.voxelpose.live.sessions import MOTION
from voxelpose.live import live_silhouettes
from voxelpose.live.live_silhouettes import PeopleInTurn, SilhouetteProcess
from voxelpose.recording.folder import Recording


def test_silhouettes_near_the_last_ones_are_those_of_the_whole_pictures(tmp_path):
    """Reduced by a factor that is no whole number."""
    recording = Recording.open(write_staged(tmp_path / "staged", MOTION, ring(2)))
    side = round(0.75 * max(recording.rig.cameras[0].size))
    process = SilhouetteProcess(recording.rig)
    whole = Silhouettes(recording, "auto", side)
    try:
        process.learn(Silhouettes(recording, "auto", side))
        for number, time_s, pictures in recording:
            moment, others = process.of(time_s, pictures)
            assert moment.time_s == time_s
            assert not others
            expected = whole.of(pictures)
            for name, mask in moment.masks().items():
                assert mask.shape == expected[name].shape
                different = np.count_nonzero(mask != expected[name])
                assert different < 0.01 * expected[name].sum()
            if number > 12:
                break
    finally:
        process.close()


def test_the_network_looks_at_one_camera_after_the_other_as_idle_time_allows():
    class Windows:
        looks = 0

        def see(self, picture):
            self.looks += 1
            time.sleep(0.01)
            return {0: picture}

    windows = {"a": Windows(), "b": Windows()}
    people, frames = PeopleInTurn(windows), {"a": "picture of a", "b": "picture of b"}
    for step, (idle_s, seen) in enumerate([(0, "a"), (0.001, ""), (1, "b"), (0, ""), (1, "a")]):
        people.idle_s += idle_s
        people.look(step, frames)
        assert [name for name in frames if people.of(name, step)] == [*seen]
    people.idle_s = 1
    people.look(5, {"a": "picture of a"})  # b is silent
    assert (windows["a"].looks, windows["b"].looks) == (3, 1)


def test_too_little_shared_memory_is_said(monkeypatch):
    if not Path("/dev/shm").is_dir():
        pytest.skip("shared memory is no file on this machine")

    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    before = set(Path("/dev/shm").iterdir())
    monkeypatch.setattr(live_silhouettes.os, "posix_fallocate", full)
    with pytest.raises(InputError, match="shared memory"):
        SilhouetteProcess(ring(2))
    assert not [path for path in set(Path("/dev/shm").iterdir()) - before if "psm_" in path.name]
