"""HumanEva's truth: the joints that its support code computes of the Plug-in Gait markers.

Source: cur_frame.m and ComputeLimbParameters.m of the support code, version 1.1 beta; written anew.
Differences: between two frames of motion capture the joints are interpolated, not the rotations; a
frame is unknown where a virtual marker used here is missing (there: any of 39 physical ones).
"""

import re
from pathlib import Path

import numpy as np
from clip import InputError, read_text
from numpy.typing import NDArray
from truth import JOINTS

FloatArray = NDArray[np.float64]

_HEAD_MM = 316.103  # top of the head over the thorax, the support code's constant
_PELVIS_BACK_MM = -50.0  # it moves the pelvis back by so much
_MARKER_RADIUS_MM = 7.0


class Markers:
    """The markers of a C3D file.

    Args:
        file: to read.

    Raises:
        InputError: it cannot be read.
    """

    def __init__(self, file: Path) -> None:
        """Reads the file; missing markers become NaN."""
        import ezc3d

        self.file = file
        if not file.is_file():
            raise InputError(f"{file} is missing: copy Mocap_Data, or give --no-truth")
        try:
            content = ezc3d.c3d(str(file))
            names = content["parameters"]["POINT"]["LABELS"]["value"]
            self._points = np.moveaxis(content["data"]["points"][:3], 0, -1).astype(np.float64)
        except (OSError, RuntimeError, ValueError, KeyError, IndexError) as error:
            raise InputError(f"{file} cannot be read as C3D ({error}): copy it again") from None
        self._places = {
            name.split(":")[-1].strip(): place for place, name in reversed([*enumerate(names)])
        }
        self._points[(self._points == 0).all(axis=2)] = np.nan

    def __getitem__(self, name: str) -> FloatArray:
        """Returns a marker's positions, (T, 3), mm."""
        return self._points[self._place(name)]

    def axes(self, name: str) -> FloatArray:
        """Returns a segment's axes, (T, 3, 3): columns x, y, z in the world.

        The origin's marker is followed by the ends of the z, x and y axes.
        """
        place = self._place(name)
        if place + 3 >= len(self._points):
            raise InputError(f"{self.file}: the axes of {name} are missing: copy it again")
        ends = self._points[[place + 2, place + 3, place + 1]] - self._points[place]
        with np.errstate(invalid="ignore", divide="ignore"):
            ends = ends / np.linalg.norm(ends, axis=2, keepdims=True)
        return np.moveaxis(ends, 0, -1)

    def _place(self, name: str) -> int:
        if name not in self._places:
            raise InputError(f"{self.file} has no marker {name}: copy it again, or give --no-truth")
        return self._places[name]


def truth(motion: Path, subject: str, first: float, step: float, count: int) -> FloatArray:
    """Returns the joints at the videos' frames.

    Args:
        motion: C3D file of the clip, beside Static.c3d and the subject's .mp file.
        subject: S1 and so on.
        first: motion-capture frame, from 0, of the first frame.
        step: motion-capture frames per frame.
        count: how many frames.

    Returns:
        (count, 15, 3) float64, m; NaN where unknown.

    Raises:
        InputError: a file is missing or cannot be read.
    """
    joints = _joints(
        Markers(motion), Markers(motion.with_name("Static.c3d")), _read_mp(motion, subject)
    )
    at = first + step * np.arange(count)
    before = np.floor(at).astype(int)
    known = (before >= 0) & (before + 1 < len(joints))
    result = np.full((count, len(JOINTS), 3), np.nan)
    part = (at - before)[known, None, None]
    result[known] = (1 - part) * joints[before[known]] + part * joints[before[known] + 1]
    return result / 1000


def _read_mp(motion: Path, subject: str) -> dict[str, float]:
    """Reads Vicon's parameters of the subject, mm."""
    file = motion.with_name(f"{subject}.mp")
    values = dict(re.findall(r"\$?(\w+)\s*=\s*(-?[\d.]+)", read_text(file)))
    for name in ("LShoulderOffset", "RShoulderOffset"):
        if name not in values:
            raise InputError(f"{file} does not say {name}: copy it again")
    return {name: float(value) for name, value in values.items()}


def _joints(markers: Markers, static: Markers, sizes: dict[str, float]) -> FloatArray:
    """Returns (T, 15, 3), mm, of every motion-capture frame."""
    pelvis, thorax = markers["PELO"], markers["TRXO"]
    trunk = np.linalg.norm(thorax - pelvis, axis=1)
    apart = np.linalg.norm(static["LSHO"] - static["RSHO"], axis=1)
    lean = np.arctan2((np.nanmean(apart) / 2 - _MARKER_RADIUS_MM) / 2, trunk)
    nothing = np.zeros_like(trunk)
    root = pelvis + _along(markers.axes("PELO"), nothing + _PELVIS_BACK_MM, nothing)
    joints = {
        "pelvis": root,
        "neck": root + _along(markers.axes("PELO"), -np.sin(lean) * trunk, np.cos(lean) * trunk),
        "head_top": thorax + _along(markers.axes("HEDO"), nothing, nothing + _HEAD_MM),
    }
    for side, letter in (("left", "L"), ("right", "R")):
        joints[f"{side}_hip"] = markers[f"{letter}FEP"]
        joints[f"{side}_knee"] = markers[f"{letter}FEO"]
        joints[f"{side}_ankle"] = markers[f"{letter}TIO"]
        arm = _arm(markers, letter, sizes[f"{letter}ShoulderOffset"])
        joints |= {f"{side}_{name}": place for name, place in arm.items()}
    return np.stack([joints[name] for name in JOINTS], axis=1)


def _arm(markers: Markers, letter: str, offset_mm: float) -> dict[str, FloatArray]:
    """Returns shoulder, elbow and wrist, (T, 3), mm; the shoulder's offset turns the upper arm."""
    shoulder, elbow, wrist = (markers[letter + name] for name in ("CLO", "HUO", "RAO"))
    upper = np.linalg.norm(elbow - shoulder, axis=1)
    lower = np.linalg.norm(wrist - elbow, axis=1)
    turn = np.arctan2(offset_mm / 2, upper)
    axes = markers.axes(f"{letter}HUO")
    end = shoulder + _along(axes, -np.sin(turn) * upper, -np.cos(turn) * upper)
    gap = elbow - (shoulder + _along(axes, 0 * upper, -upper))
    hand = _along(markers.axes(f"{letter}RAO"), np.sin(turn) * lower, -np.cos(turn) * lower)
    return {"shoulder": shoulder, "elbow": end, "wrist": end + gap + hand}


def _along(axes: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
    """Returns the world's vectors, (T, 3), of local ones (x, 0, z)."""
    return axes[:, :, 0] * x[:, None] + axes[:, :, 2] * z[:, None]
