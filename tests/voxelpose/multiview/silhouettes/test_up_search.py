"""Which way is up, where the cameras alone leave a doubt: the person decides."""

from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from calib.upright import AXES, Z_UP, UprightFrame
from silhouette_core.estimator import Settings
from silhouette_core.image.raster import render_parts
from silhouette_core.motion import kinematics
from silhouette_core.progress import SilentReporter
from tests.clips import waving
from tests.sources import ring
from voxelpose.multiview.silhouettes import up_search
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparationSettings, observer_of
from voxelpose.multiview.silhouettes.up_search import choose_upright

MOTION = waving(5)
ROLL = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def on_its_side(camera):
    """A camera turned about its own axis by a quarter, its picture with it."""
    (fx, _, cx), (_, fy, cy), _ = camera.matrix
    width, height = camera.size
    return replace(
        camera,
        size=(height, width),
        matrix=np.array([[fy, 0, cy], [0, fx, width - 1 - cx], [0, 0, 1.0]]),
        rotation=ROLL @ camera.rotation,
        translation=ROLL @ camera.translation,
    )


def filmed(rig, up, stated=None, floor_m=0.0):
    """Up as chosen for a walk before cameras whose world has `up` upward, and whether poses were
    searched.
    """
    frame = UprightFrame.from_up(AXES[up], floor_m)
    rotation, origin = MOTION.parts()
    store = MaskStore([camera.size for camera in rig], len(MOTION))
    mesh = MOTION.model.faces, MOTION.model.face_part
    for t in range(len(MOTION)):
        skin = kinematics.skin(MOTION.model, rotation[t], origin[t])
        seen = ((skin @ camera.rotation.T + camera.translation, camera) for camera in rig)
        store.put(t, [render_parts(s, *mesh, c.matrix, c.size)[0] > 0 for s, c in seen])
    poses = [(c.rotation @ frame.rotation, c.rotation @ [0, 0, floor_m]) for c in rig]
    world = Rig(
        tuple(
            replace(camera, rotation=turn, translation=camera.translation - shift)
            for camera, (turn, shift) in zip(rig, poses, strict=True)
        )
    )
    reporter, prepared = Noting(), PreparationSettings(0.025, 0, "off")

    def observer(rig):
        return observer_of(rig, store, prepared)

    chosen = choose_upright(world, Settings(1.7, up=stated), store, observer, reporter)
    store.close()
    return chosen.up, reporter


class Noting(SilentReporter):
    """Keeps what is said."""

    def __init__(self):
        self.notes, self.stages = [], []

    def note(self, text):
        self.notes.append(text)

    def stage(self, name, total=None):
        self.stages.append(name)


def test_cameras_that_stand_upright_in_a_world_with_z_up_cost_nothing(monkeypatch):
    monkeypatch.setattr(up_search, "find_pose", None)
    up, reporter = filmed(ring(4, (160, 120)), "z")
    np.testing.assert_array_equal(up, Z_UP)
    assert not reporter.notes and not reporter.stages


def test_what_is_stated_holds(monkeypatch):
    monkeypatch.setattr(up_search, "find_pose", None)
    up, reporter = filmed(ring(4, (160, 120)), "z", stated=(0.0, -1.0, 0.0))
    np.testing.assert_allclose(up, [0, -1, 0], atol=1e-12)
    assert not reporter.notes


@pytest.mark.slow
def test_a_world_on_its_side_is_turned_and_said():
    chosen, reporter = filmed(ring(4, (320, 240)), "y", floor_m=0.6)
    np.testing.assert_array_equal(chosen, AXES["y"])
    assert "up is y of the calibration's world" in reporter.notes[0]


@pytest.mark.slow
def test_where_all_cameras_lie_on_their_side_the_person_decides():
    """The pictures alone explain both, and some horizontal directions, equally well."""
    sideways = Rig(tuple(on_its_side(camera) for camera in ring(4, (320, 240))))
    chosen, reporter = filmed(sideways, "-z")
    np.testing.assert_array_equal(chosen, AXES["-z"])
    assert "which way is up" in reporter.stages
