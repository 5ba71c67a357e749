"""Random motion of a body of which none was recorded, and libraries of such bodies."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from examples.bodies.example_bodies import desk_lamp, quadruped, robot_arm
from silhouette_core.monocular.body_library import sampled_motion
from silhouette_core.monocular.making.from_motion import make_library, read_clips
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.store import read_library, write_library
from silhouette_core.monocular.tree.summary import summary, write_sheet
from silhouette_core.motion.motion_file import write_motion

SETTINGS = LibrarySettings(60, yaw_step_deg=60, mirror=False, thresholds=(0.05, 0.03, 0.02))


def lamp_motion(frames: int = 300, seed: int = 0):
    return sampled_motion(desk_lamp(), np.random.default_rng(seed), frames)


@pytest.mark.parametrize("body", [robot_arm, quadruped])
def test_sampled_motion_is_smooth_and_keeps_to_the_limits(body):
    model = body()
    motion = sampled_motion(model, np.random.default_rng(3), 900)
    low, high = model.tree.dof_limits_rad.T
    assert (motion.angles_rad >= low - 1e-12).all() and (motion.angles_rad <= high + 1e-12).all()
    free = ~model.tree.dof_fixed
    assert (np.ptp(motion.angles_rad, axis=0) > 0.5 * (high - low))[free].all()
    most = np.abs(np.diff(motion.angles_rad, axis=0)).max(0)
    assert (most < 0.2 * (high - low))[free].all()
    same = sampled_motion(model, np.random.default_rng(3), 900)
    np.testing.assert_array_equal(motion.angles_rad, same.angles_rad)


def test_only_a_free_root_leans():
    upright = [1.0, 0, 0, 0]
    assert (lamp_motion().root_quaternion == upright).all()
    leaning = sampled_motion(quadruped(), np.random.default_rng(0), 90).root_quaternion
    lean_deg = 2 * np.degrees(np.arccos(leaning[:, 0]))
    assert 3 < lean_deg.max() < 40 and np.abs(leaning[:, 3]).max() < 0.05


def test_a_library_keeps_a_body_that_is_no_persons(tmp_path):
    made = build_library(base_poses({"sampled": lamp_motion()}, SETTINGS), desk_lamp(), SETTINGS)
    write_library(made, tmp_path / "lamp.vplib")
    read = read_library(tmp_path / "lamp.vplib")
    assert read.model.person is None and read.model.tree.root_fixed
    assert (
        read.model.names == made.model.names
        and read.model.tree.dof_names == made.model.tree.dof_names
    )
    np.testing.assert_array_equal(read.model.vertices_m, made.model.vertices_m)
    np.testing.assert_array_equal(read.bases.angles, made.bases.angles)
    damaged = replace(made, model=replace(desk_lamp(), vertices_m=np.full((3, 3), np.nan)))
    write_library(damaged, tmp_path / "damaged.vplib")
    with pytest.raises(InputError, match=r"damaged\.vplib is damaged"):
        read_library(tmp_path / "damaged.vplib")
    assert "4 parts, root base" in summary(read, tmp_path / "lamp.vplib")
    write_sheet(read, tmp_path / "sheet.png")
    assert (tmp_path / "sheet.png").stat().st_size > 1000


def test_a_silhouette_is_as_large_as_the_body():
    """The lamp's extent takes as many pixels of the window as a person's stature."""
    rest = replace(lamp_motion(2), angles_rad=np.zeros((2, 4)))
    settings = replace(SETTINGS, yaw_step_deg=360, poses=1, pitches_deg=(0.0,))
    library = build_library(base_poses({"rest": rest}, settings), desk_lamp(), settings)
    assert len(library) == 1
    rows = np.flatnonzero(library.render(np.array([0])).windows[0].any(axis=1))
    height = np.ptp(desk_lamp().vertices_m[:, 2]) / desk_lamp().extent_m
    assert 0.95 < (np.ptp(rows) + 1) / (STATURE_PX * height) < 1.35  # the nearer is larger


def test_a_library_is_built_from_motions_of_the_body_itself(tmp_path):
    for name, seed in (("one", 0), ("two", 1)):
        write_motion(lamp_motion(60, seed), tmp_path / f"{name}.safetensors")
    paths = [tmp_path / "one.safetensors", tmp_path / "two.safetensors"]
    clips = read_clips(paths, desk_lamp())
    assert list(clips) == ["one", "two"] and len(clips["two"]) == 60
    settings = replace(SETTINGS, mirror=True)
    library = make_library(clips, desk_lamp(), tmp_path / "l.vplib", settings)
    assert library.proposal is None and not library.bases.mirrored.any()
    assert library.settings.weighting == "xor"
    with pytest.raises(InputError, match=r"two\.safetensors is the motion of a body with other"):
        read_clips(paths[1:], robot_arm())
