"""Films of people in profile who swing the right arm, no two swings alike.

They are the demo's: a clothed actor in a painted room with noise, flicker and a cast shadow, whose
silhouettes are cut by background subtraction as in section 5.1 of paper A.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.tailoring import Measurements, tailor
from calib.camera import Camera
from calib.components import label_components
from papers.swings import arm_angles
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.background import BackgroundModel
from silhouette_core.progress import Reporter
from voxelpose.demo.choreography import Performance
from voxelpose.demo.room import FilmCamera, demo_rig

SWINGS = 24  # the paper's
FPS = 15
PITCH_DEG = 5.0
"""Downward angle of the camera toward the person."""
FACING_DEG = 40.0
"""Yaw of a person who faces it."""
_CAMERA = 2  # of the demo's
_EMPTY = 24
# Usual measurements over the stature, the range of factors on each, and the range of people with
# wide trunks and a narrow chest, thus thin arms.
_BUILD = {
    "chest_girth_m": (0.55, (0.90, 1.15), (0.80, 0.90)),
    "waist_girth_m": (0.47, (0.90, 1.35), (1.25, 1.50)),
    "hip_girth_m": (0.57, (0.92, 1.15), (1.05, 1.20)),
}
_PROPORTIONS = ("legs", "arms", "shoulders", "head")
# Ranges at the turning points, degrees.
_SWAY = {"yaw": (-6, 6), "lean": (0, 4), "twist": (-4, 4), "l_arm": (-5, 10), "r_out": (4, 16)}
_BACK_DEG, _FORTH_DEG, _PERIOD_S = (-60.0, -25.0), (45.0, 95.0), (1.2, 2.2)
_ELBOW_BACK_DEG, _ELBOW_FORTH_DEG = (4.0, 20.0), (5.0, 45.0)


@dataclass(frozen=True, eq=False)
class SwingFilm:
    """Silhouettes of a person who swings the right arm, and the truth.

    Attributes:
        camera: without distortion.
        bits: (T, height, width / 8) uint8, silhouettes packed along the columns.
        truth_deg: (T,) angle of the right upper arm, see `arm_angles`.
    """

    camera: Camera
    bits: NDArray[np.uint8]
    truth_deg: NDArray[np.float64]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.bits)

    def mask(self, frame: int) -> NDArray[np.bool_]:
        """Silhouette of a frame, (height, width) bool."""
        return np.unpackbits(self.bits[frame], axis=1, count=self.camera.size[0]).view(bool)


def drawn_person(rng: np.random.Generator, wide: bool = False) -> Measurements:
    """A person of any proportions and any build, or with thin arms before a wide trunk."""
    stature_m = rng.uniform(1.55, 1.85)
    girths = {
        name: usual * stature_m * rng.uniform(*factors[wide])
        for name, (usual, *factors) in _BUILD.items()
    }
    return Measurements(
        stature_m, **girths, **{name: rng.uniform(0.94, 1.06) for name in _PROPORTIONS}
    )


def drawn_swings(rng: np.random.Generator, near: bool, swings: int = SWINGS) -> Performance:
    """Swings of the right arm, from hanging to hanging, each at a constant speed of its own.

    Args:
        rng: source of amplitudes, periods, bends of the elbow and sway.
        near: whether the right side is toward the camera; else the trunk hides the arm in passing.
        swings: their number.
    """
    points = 2 * swings + 3  # hanging, back and (forth, back) for each, hanging
    time_s = np.cumsum(np.r_[0, 0.4, np.repeat(rng.uniform(*_PERIOD_S, swings) / 2, 2), 0.4])
    forth = np.arange(points) % 2 == 0
    arm = np.where(forth, rng.uniform(*_FORTH_DEG, points), rng.uniform(*_BACK_DEG, points))
    bend = rng.uniform(*_ELBOW_FORTH_DEG, points), rng.uniform(*_ELBOW_BACK_DEG, points)
    arm[[0, -1]] = 0.0
    sway = {name: rng.uniform(*limits, points) for name, limits in _SWAY.items()}
    sway["yaw"] += FACING_DEG + (90.0 if near else -90.0)
    keys = np.column_stack([time_s, *sway.values(), arm, np.where(forth, *bend)])
    return Performance(f"{' '.join(sway)} r_arm r_elbow", keys, FPS, interpolation="linear")


def film(
    person: Measurements, played: Performance, rng: np.random.Generator, reporter: Reporter
) -> SwingFilm:
    """Films a performance and cuts out the silhouettes, of which the largest component each.

    Args:
        person: who performs.
        played: the performance.
        rng: source of the pictures' noise.
        reporter: notified of every frame.
    """
    actor, camera = tailor(person), demo_rig(_CAMERA + 1).cameras[_CAMERA].pinhole()
    view = FilmCamera(camera, rng)
    background = BackgroundModel.from_frames((view.empty() for _ in range(_EMPTY)), "paper")
    bits, joints_m = [], []
    for frame in range(played.frames):
        vertices, joints = actor.pose(*played.pose_at(frame / FPS))
        mask = background.silhouette(view.picture(vertices, actor.faces, actor.face_colour))
        bits.append(np.packbits(largest_component(mask), axis=1))
        joints_m.append([joints[name] for name in LANDMARK_NAMES])
        reporter.advance()
    return SwingFilm(camera, np.stack(bits), arm_angles(np.array(joints_m)))


def largest_component(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Largest connected component of a foreground image (h, w) bool; empty if it is."""
    components = label_components(mask)
    if len(components.sizes) < 2:
        return np.zeros_like(mask)
    return components.labels == 1 + int(components.sizes[1:].argmax())
