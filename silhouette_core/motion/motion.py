"""Motion: the result of every estimator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calib.checks import FloatArray, IntArray, check_array
from calib.upright import Z_UP, UprightFrame

if TYPE_CHECKING:
    from silhouette_core.body.model import BodyModel
    from silhouette_core.motion.conditioning import Conditioning


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses of one body over time."""

    fps: float
    model: BodyModel  #: the body; it defines the order of parts and joint angles.
    root_m: FloatArray  #: (T, 3) float64, position of the root part's joint in the world, metres.
    root_quaternion: FloatArray  #: (T, 4) float64, unit, w x y z, world_from_body of the root part.
    angles_rad: FloatArray  #: (T, D) float64, joint angles, radians.
    frames: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    """(T,) int64, increasing, frame of the recording of each pose; lost frames are left out."""
    time_s: FloatArray = field(default_factory=lambda: np.zeros(0))  #: (T,) float64, increasing.
    quality: Mapping[str, NDArray] = field(default_factory=dict)
    """Arrays with T rows. Known names, all optional: `part_overlap` (T, P), fraction of the part's
    volume inside the hull; `part_unsupported` (T, P) bool, no voxel supports the part;
    `unexplained` (T,), fraction of the hull's voxels that no part covers; `outside` (T,), fraction
    of the body outside the hull; `outline_agreement` (T,), share of their union that body and
    silhouettes have in common, the mean over the cameras, and `camera_agreement` (T, C) of each;
    `joint_disagreement` (T, 15), share of the surroundings of each joint in which they differ;
    `joint_sigma_mm` (T, 15), its standard deviation by the outlines; `joint_error_mm` (T, 15),
    median error to expect; `landmark_confidence` (T, 15), probability that a joint is within 30 mm
    of the truth; `right_probability` (T,), that the joints' mean error is below 80 mm;
    `pose_probability` (T,), of the likeliest hypothesis that one camera leaves, and `pose_error_mm`
    (T,), the mean over the joints of the median error to expect, relative to the pelvis."""
    up: FloatArray = field(default_factory=Z_UP.copy)
    """(3,) float64, unit, direction of up in the world."""
    floor_m: float = 0.0  #: height of the floor in the world, along up, metres.
    filled: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    """(T,) bool, whether the frame's pose is interpolated, since none was found."""
    conditioning: Conditioning | None = None
    """Filter and filling of gaps that made these poses; None: not recorded."""
    unfiltered: Motion | None = None  #: The poses before that, without quality; None: no others.
    corrections: tuple[str, ...] = ()  #: What was corrected by hand, in words.
    sampled_from: Motion | None = None
    """The motion at the rate at which it was filtered, if that is another; kept in no file."""

    def __post_init__(self) -> None:
        """Completes frames, times and what is filled if not given, and checks the arrays. Raises
        ValueError where an array has another shape than stated, or holds NaN.
        """
        count = len(self.root_m)
        if not len(self.frames) and count:
            object.__setattr__(self, "frames", np.arange(count, dtype=np.int64))
        if not len(self.time_s) and count:
            object.__setattr__(self, "time_s", self.frames / self.fps)
        if not len(self.filled) and count:
            object.__setattr__(self, "filled", np.zeros(count, bool))
        shapes = {
            "root_m": (self.root_m, (count, 3)),
            "root_quaternion": (self.root_quaternion, (count, 4)),
            "angles_rad": (self.angles_rad, (count, len(self.model.tree.dof_part))),
            "frames": (self.frames, (count,)),
            "time_s": (self.time_s, (count,)),
            "up": (self.up, (3,)),
            "filled": (self.filled, (count,)),
        }
        for name, (array, shape) in shapes.items():
            check_array(name, array, shape, finite=True)
        if (np.diff(self.frames) <= 0).any():
            raise ValueError("frames must increase")
        for name, array in self.quality.items():
            if len(array) != count:
                raise ValueError(f"quality {name!r} must have {count} rows, got {len(array)}")
        if self.unfiltered is not None:  # in the same world
            same = replace(self.unfiltered, up=self.up, floor_m=self.floor_m)
            object.__setattr__(self, "unfiltered", same)
        object.__setattr__(self, "quality", MappingProxyType(dict(self.quality)))

    def __len__(self) -> int:
        """Number of frames with a pose."""
        return len(self.root_m)

    def parts(self) -> tuple[FloatArray, FloatArray]:
        """Rotations and positions of all parts.

        Returns:
            (T, P, 3, 3) world_from_part rotations and (T, P, 3) origins in the world, metres: the
            joints at the parts' proximal ends.
        """
        from silhouette_core.motion import kinematics

        return kinematics.forward(self.model, self.root_m, self.root_quaternion, self.angles_rad)

    def landmarks(self) -> FloatArray:
        """Joints of joints.csv (T, L, 3) in the world, metres, in the order of the body's
        `landmark_names`: of a person (T, 15, 3).
        """
        from silhouette_core.motion import kinematics

        return kinematics.joint_centres(self.model, *self.parts())

    def standing_at(self, landmarks_m: FloatArray) -> Motion:
        """The same poses, moved to where the landmarks are on average nearest to given ones
        (T, L, 3).
        """
        return replace(self, root_m=self.root_m + (landmarks_m - self.landmarks()).mean(axis=1))

    @property
    def upright_frame(self) -> UprightFrame:
        """The frame with z up and the floor at z = 0."""
        return UprightFrame.from_up(self.up, self.floor_m)

    def upright(self) -> Motion:
        """The same motion in a world that is its upright frame."""
        frame = self.upright_frame
        if frame.is_world:
            return self
        turned = self._turned(frame.rotation)
        return replace(
            turned,
            root_m=frame.points(self.root_m),
            up=Z_UP.copy(),
            floor_m=0.0,
            unfiltered=None if self.unfiltered is None else self.unfiltered.upright(),
        )

    def in_world(self, frame: UprightFrame) -> Motion:
        """A motion that was estimated in an upright frame, in the world in which that frame is."""
        if frame.is_world:
            return self
        turned = self._turned(frame.rotation.T)
        return replace(
            turned,
            root_m=frame.world_points(self.root_m),
            up=frame.up,
            floor_m=frame.floor_m + self.floor_m,
            unfiltered=None if self.unfiltered is None else self.unfiltered.in_world(frame),
        )

    def _turned(self, rotation: FloatArray) -> Motion:
        from silhouette_core.motion.kinematics import quaternions, rotation_matrices

        turned = quaternions(rotation @ rotation_matrices(self.root_quaternion))
        return replace(self, root_quaternion=turned)

    def landmark_confidence(self) -> FloatArray:
        """Confidence (T, 15) of the landmarks, from 0 to 1.

        As stated by the estimator, else the overlap of the landmark's part, else the confidence of
        the frame; 0 in frames that were filled, and where it is unknown.
        """
        return np.nan_to_num(np.where(self.filled[:, None], 0.0, self._stated_confidence()))

    def _stated_confidence(self) -> FloatArray:
        if "landmark_confidence" in self.quality:
            return np.asarray(self.quality["landmark_confidence"], float)
        if "part_overlap" in self.quality:
            overlap = np.asarray(self.quality["part_overlap"], float)[
                :, self.model.tree.landmark_part
            ]
            return np.clip(overlap, 0.0, 1.0)
        frame = np.asarray(self.quality.get("outline_agreement", np.ones(len(self))), float)
        return np.repeat(frame[:, None], len(self.model.tree.landmark_part), axis=1)

    def select(self, rows: slice | NDArray) -> Motion:
        """Motion of some rows (not frame numbers)."""
        names = "root_m", "root_quaternion", "angles_rad", "frames", "time_s", "filled"
        chosen, other = {name: getattr(self, name)[rows] for name in names}, self.unfiltered
        if other is not None:
            other = other.select(np.flatnonzero(np.isin(other.frames, chosen["frames"])))
        quality = {name: array[rows] for name, array in self.quality.items()}
        return replace(self, **chosen, unfiltered=other, quality=quality)


def posed_times(motions: Sequence[Motion]) -> dict[int, float]:
    """Time, s, of every frame in which somebody has a pose, in their order."""
    times = [zip(one.frames.tolist(), one.time_s.tolist(), strict=True) for one in motions]
    return dict(sorted({frame: time for pairs in times for frame, time in pairs}.items()))
