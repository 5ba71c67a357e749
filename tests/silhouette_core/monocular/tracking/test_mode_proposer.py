"""Distance, memory, body and colours of a person's proposals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.image.seen_joints import SeenJoints
from silhouette_core.monocular.person import Person, upright_distance
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.tracking import mode_proposer
from silhouette_core.monocular.tracking.mode_proposer import ModeProposer
from silhouette_core.monocular.tracking.pose_modes import ModeFinder
from silhouette_core.progress import StageClock
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import (
    STATURE_M,
    body,
    camera_at,
    performed,
    poses_of,
    proposed,
    silhouette,
)

CAMERA = camera_at((0.0, -4.0, 1.3))
POSE = poses_of(performed("walk"))[0]
PERSON = Person(silhouette(body(), POSE, CAMERA), False)
TRUE_M = 3.0  # what the network says


class Network(ModeFinder):
    """A finder that corrects half of what a distance is off, as a logarithm."""

    def __init__(self):
        self.camera, self.stature_m = CAMERA, STATURE_M
        self.read_m, self.views, self.facing, self.coloured = [], [], [], []
        self.joints = []

    def view(self, window, time_s, joints):
        self.read_m.append(window.distance_m)
        self.joints.append(joints)
        return SimpleNamespace(window=window, time_s=time_s, inside=None)

    def distance(self, views):
        self.views.append([view.time_s for view in views])
        return float(np.sqrt(views[-1].window.distance_m * TRUE_M))

    def with_inside(self, view, inside):
        return SimpleNamespace(**vars(view) | {"inside": inside})

    def corrected(self, views, masks):
        return list(views)

    def find(self, views, facing):
        self.facing.append(facing)
        self.coloured.append([view.inside is not None for view in views])
        return [proposed([POSE], [1.0]) for _ in views]

    def newest(self, views, facing):
        self.views.append([view.time_s for view in views])
        self.coloured.append([view.inside is not None for view in views])
        return proposed([POSE], [1.0], TRUE_M)


class Colours:
    """Stands for `ColourEvidence`: the head's colours are known once anything was learned."""

    def __init__(self):
        self.learned = []

    def learn(self, people, joints_m):
        self.learned.append(len(people))
        return True

    def inside(self, window, person):
        return "inside" if self.learned else None


def proposer_of(monkeypatch, smooth=True, sexes=(), facing=True):
    network, colours = Network(), Colours()
    monkeypatch.setattr(mode_proposer, "ModeFinder", lambda *_: network)
    monkeypatch.setattr(mode_proposer, "ColourEvidence", lambda _: colours)
    clock = StageClock()
    return (
        ModeProposer(None, CAMERA, body(), sexes, facing, smooth, clock, CpuBackend()),
        network,
        colours,
    )


def test_the_first_distance_is_corrected_three_times(monkeypatch):
    """Upright at first; every round corrects half of what is left."""
    proposer, network, _ = proposer_of(monkeypatch)
    note = proposer.note(0.0, PERSON)
    first = upright_distance(CAMERA, PERSON.mask, STATURE_M)
    off = np.log(first / TRUE_M)
    assert off > 0.2
    assert np.log(np.array(network.read_m) / TRUE_M) == pytest.approx(off / 2 ** np.arange(4))
    assert note[0].window.distance_m == network.read_m[-1] and note[1] is None


def test_joints_that_are_seen_are_read_with_every_view(monkeypatch):
    proposer, network, _ = proposer_of(monkeypatch)
    seen = SeenJoints(np.ones((15, 3)), np.ones(15))
    proposer.note(0.0, replace(PERSON, joints=seen))
    proposer.note(0.1, PERSON)
    assert network.joints == [seen] * 4 + [None]


def test_a_frame_is_read_at_the_distance_that_the_last_ones_tell(monkeypatch):
    proposer, network, _ = proposer_of(monkeypatch)
    proposer.note(0.0, PERSON)
    proposer.note(0.1, PERSON)
    assert network.read_m[4] == pytest.approx(np.sqrt(network.read_m[3] * TRUE_M))
    assert network.views[-1] == [0.0, 0.1]


@pytest.mark.parametrize(("later_s", "anew"), [(0.7, False), (0.85, True)])
def test_frames_of_the_last_moments_are_read(monkeypatch, later_s, anew):
    """After a longer time the distance is a first one."""
    proposer, network, _ = proposer_of(monkeypatch)
    for time_s in (0.0, 0.05, 0.05 + later_s):
        proposer.note(time_s, PERSON)
    assert network.views[-1] == pytest.approx([0.9] if anew else [0.0, 0.05, 0.75])
    assert len(network.read_m) == (9 if anew else 6)


def test_who_may_face_the_camera_does_so_first_of_all(monkeypatch):
    for facing in (True, False):
        proposer, network, colours = proposer_of(monkeypatch, facing=facing)
        notes = [proposer.note(k / 30, PERSON) for k in range(3)]
        modes = proposer.propose(notes, [PERSON] * 3, True)
        proposer.propose(notes, [PERSON] * 3, False)
        # Twice each: as soon as the head is found, its colours are read, too.
        assert network.facing == [facing, facing, False, False]
        assert network.coloured == [[False] * 3, [True] * 3] * 2
        assert len(modes) == 3 and colours.learned == [3, 3]


def test_the_body_is_adapted_once(monkeypatch):
    asked = []

    def adapted(model, sexes, views, masks, modes, backend):
        asked.append((sexes, len(masks), len(modes)))
        return replace(model)

    monkeypatch.setattr(mode_proposer, "adapted_body", adapted)
    proposer, *_ = proposer_of(monkeypatch, sexes=("male", "female"))
    before = proposer.model
    notes = [proposer.note(k / 30, PERSON) for k in range(2)]
    for first in (True, False):
        proposer.propose(notes, [PERSON] * 2, first)
    assert asked == [(("male", "female"), 2, 2)] and proposer.model is not before
    given, *_ = proposer_of(monkeypatch, sexes=())
    given.propose([given.note(0.0, PERSON)], [PERSON], True)
    assert len(asked) == 1


def test_frame_by_frame_the_newest_is_asked_for(monkeypatch):
    """Its distance is the next one's, its window's picture is kept, colours come from the past."""
    proposer, network, colours = proposer_of(monkeypatch, smooth=False)
    for frame in range(7):
        note = proposer.note(frame / 30, PERSON)
        (modes,) = proposer.propose([note], [PERSON], frame == 0)
        assert modes.window is note[1] and note[1].mask.any()
        proposer.learn(frame, PERSON, np.zeros((15, 3)))
    assert network.read_m[4:] == [TRUE_M] * 6
    assert network.coloured[-1] == [False] + [True] * 6  # from the first frame on
    assert colours.learned == [1] * 2  # of frames 0 and 5


@pytest.mark.slow
def test_who_crouches_at_first_is_not_far_away():
    """Half way down, a silhouette is as high as that of somebody who stands farther away."""
    camera, poses = camera_at((1.2, -3.8, 1.9)), poses_of(performed("squat"))
    pose = poses[19]
    crouching = Person(silhouette(body(), pose, camera), False)
    true_m = float(np.linalg.norm(pose.root_m - camera.center_m))
    assert upright_distance(camera, crouching.mask, STATURE_M) > 1.09 * true_m
    proposer = ModeProposer(
        shipped_proposal(), camera, body(), (), False, True, StageClock(), CpuBackend()
    )
    note = proposer.note(0.0, crouching)
    assert note[0].window.distance_m == pytest.approx(true_m, rel=0.05)
