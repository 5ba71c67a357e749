"""The sound of videos."""

from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from scipy.io import wavfile

from calib.errors import InputError
from voxelpose.recording import sound

HZ = 16000


def clap_at(seconds: float, *at_s: float, noise: float = 0.002, seed: int = 0) -> np.ndarray:
    heard = noise * np.random.default_rng(seed).normal(size=int(seconds * HZ))
    burst = np.random.default_rng(1).normal(size=160) * np.exp(-np.arange(160) / 40)
    for time_s in at_s:
        begin = round(time_s * HZ)
        heard[begin : begin + 160] += 0.3 * burst
    return heard


def write_heard(
    path: Path, heard: np.ndarray | None, fps: float = 25.0, seconds: float = 4
) -> Path:
    """Writes a grey video with sound."""
    wave = path.with_suffix(".wav")
    if heard is not None:
        wavfile.write(wave, HZ, np.int16(heard * 32767))
    writer = imageio_ffmpeg.write_frames(
        str(path),
        (64, 48),
        fps=fps,
        audio_path=None if heard is None else str(wave),
        ffmpeg_log_level="error",
    )
    writer.send(None)
    for _ in range(int(seconds * fps)):
        writer.send(np.full((48, 64, 3), 90, np.uint8))
    writer.close()
    wave.unlink(missing_ok=True)
    return path


def test_a_clap_is_a_peak_and_noise_is_nothing(tmp_path):
    path = write_heard(tmp_path / "cam_1.mp4", clap_at(4, 1.234))
    assert sound.has_sound(path)
    signal = sound.onsets(path, "cam_1", 60.0)
    assert signal.camera == "cam_1"
    assert signal.period_s == pytest.approx(sound.STEP_S)
    peak = int(signal.values[:, 0].argmax())
    assert signal.time_s[peak] == pytest.approx(1.234, abs=0.006)
    far = np.abs(signal.time_s - 1.234) > 0.1
    assert signal.values[far].sum() < 0.02 * signal.values.sum()
    assert len(sound.onsets(path, "cam_1", 2.0).time_s) == pytest.approx(2000, abs=30)


def test_sound_is_in_the_time_of_the_pictures(tmp_path, monkeypatch):
    path = write_heard(tmp_path / "cam_1.mp4", clap_at(4, 2.0))
    usual = sound.onsets(path, "cam_1", 60.0)
    monkeypatch.setattr(sound, "_first_picture_s", lambda path: 0.25)
    np.testing.assert_allclose(sound.onsets(path, "cam_1", 60.0).time_s, usual.time_s - 0.25)


def test_pictures_may_begin_after_the_sound(tmp_path):
    path = write_heard(tmp_path / "cam_1.mp4", clap_at(4, 2.0))
    late = tmp_path / "late.mp4"
    words = ["-itsoffset", "0.2", "-i", str(path), "-i", str(path), "-map", "0:v", "-map", "1:a"]
    sound.subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", *words, "-c", "copy", str(late)],
        check=True,
    )
    assert sound._first_picture_s(path) == pytest.approx(0.0, abs=0.001)
    assert sound._first_picture_s(late) == pytest.approx(0.2, abs=0.001)


def test_a_video_without_sound_is_told_of(tmp_path):
    path = write_heard(tmp_path / "cam_1.mp4", None, seconds=1)
    assert not sound.has_sound(path)
    assert not sound.has_sound(tmp_path)
    with pytest.raises(InputError, match="no sound that can be read"):
        sound.onsets(path, "cam_1", 60.0)


def test_without_ffmpeg_a_remedy_is_named(tmp_path, monkeypatch):
    def missing():
        raise RuntimeError("none")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    path = tmp_path / "cam_1.mp4"
    path.write_bytes(b"")
    with pytest.raises(InputError, match="IMAGEIO_FFMPEG_EXE"):
        sound.has_sound(path)
