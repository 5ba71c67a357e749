"""Frames decided in blocks: gaps, lost frames, and what the proposer is told."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.head_colours import ColourCrop
from silhouette_core.monocular.occlusion import standing_areas
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking import trajectory
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.monocular.tracking.trajectory import PendingFrame, PoseTrajectory
from silhouette_core.progress import StageClock
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_at,
    performed,
    poses_of,
    proposed,
    silhouette,
)

CAMERA = camera_at((0.4, -4.0, 1.3), size=(320, 240))
POSES = poses_of(performed("wave"))
QUICK = replace(TrackerSettings().coarser(), surface_points=150)
AREAS = standing_areas(body())


class KnownPoses:
    """Proposes the poses of frames as they are; notes are their numbers."""

    def __init__(self, model=None):
        self.model = model or body()
        self.asked, self.learned = [], []

    def propose(self, notes, people, first):
        self.asked.append((list(notes), first))
        assert all(person.mask.any() for person in people)
        return [proposed([POSES[number]], [1.0]) for number in notes]

    def learn(self, number, person, joints_m):
        self.learned.append((number, joints_m))


class Steps:
    """A tracker's steps, watched."""

    def __init__(self, monkeypatch):
        self.past, self.beams = [], []
        step = HypothesisTracker.step

        def watched(tracker, observed, proposal, past, *known, **searched):
            self.past.append(past)
            self.beams.append(step(tracker, observed, proposal, past, *known, **searched))
            return self.beams[-1]

        monkeypatch.setattr(HypothesisTracker, "step", watched)


def track(rows, times, smooth=True, masks=None, proposer=None, settings=QUICK):
    """Estimates of frames, whose numbers are rows of the motion."""
    tracker = HypothesisTracker(body(), CAMERA, AREAS, settings, CpuBackend())
    proposer = proposer or KnownPoses()
    tracked = PoseTrajectory(tracker, proposer, smooth, StageClock())
    found = []
    for row, time_s in zip(rows, times, strict=True):
        mask = (masks or {}).get(row, silhouette(body(), POSES[row], CAMERA))
        person = Person(mask, False)
        found += tracked.add(PendingFrame.of(row, time_s, person, row))
    return [*found, *tracked.finish()], tracked


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize(("gap_s", "anew"), [(0.9, False), (1.1, True)])
def test_after_more_than_a_second_a_person_is_new(smooth, gap_s, anew, monkeypatch):
    steps = Steps(monkeypatch)
    times = [0.0, 0.1, 0.1 + gap_s, 0.2 + gap_s]
    found, _ = track([0, 1, 2, 3], times, smooth)
    assert [frame.time_s for frame in found] == times
    assert steps.past[0] == (None, None) and steps.past[1][1] is None
    assert steps.past[2] == (None, None) if anew else steps.past[2][0].time_s == times[1]
    assert (steps.beams[2].back == -1).all() == anew
    assert steps.past[3][0].time_s == times[2]


def test_the_time_between_is_a_gap_in_both_directions(monkeypatch):
    steps = Steps(monkeypatch)
    settings = replace(QUICK, both_ways=True)
    times = [0.0, 0.1, 1.5, 1.6]
    track([0, 1, 2, 3], times, settings=settings)
    assert len(steps.beams) == 12  # forward, backward, forward again
    gaps = [
        None if past[0] is None else round(beam.time_s - past[0].time_s, 6)
        for past, beam in zip(steps.past, steps.beams, strict=True)
    ]
    assert gaps == [None, 0.1] * 6


def test_what_resembles_nothing_is_lost_and_found_again():
    box = np.zeros(CAMERA.size[::-1], bool)
    box[100:140, 70:250] = True
    found, _ = track(range(6), np.arange(6) / 10, smooth=False, masks={3: box})
    assert [frame.lost for frame in found] == [False, False, False, True, False, False]
    assert found[3].error > 0.5 > 0.25 > found[2].error


def test_a_first_frame_is_not_lost_and_the_usual_fit_is_that_of_frames_not_lost():
    """After ten frames of a box that is no person, the person is what is usual still."""
    box = np.zeros(CAMERA.size[::-1], bool)
    box[100:140, 70:250] = True
    rows = list(range(14))
    found, _ = track(rows, np.array(rows) / 10, False, masks=dict.fromkeys(rows[2:12], box))
    assert [frame.lost for frame in found] == [2 <= row < 12 for row in rows]


def test_blocks_follow_one_another(monkeypatch):
    """Each block begins with the hypotheses chosen at the end of the last one."""
    monkeypatch.setattr(trajectory, "_BLOCK", 3)
    monkeypatch.setattr(trajectory, "_AHEAD", 2)
    steps, proposer = Steps(monkeypatch), KnownPoses()
    found, _ = track(range(7), np.arange(7) / 10, proposer=proposer)
    assert [frame.number for frame in found] == list(range(7))
    assert proposer.asked == [([0, 1, 2, 3, 4], True), ([3, 4, 5, 6], False)]
    before = steps.past[5]  # of the first frame of the second block
    assert [len(one.poses) for one in before] == [1, 1]
    assert [one.time_s for one in before] == pytest.approx([0.2, 0.1])
    for frame in found:
        own, truth = (joints_at(body(), pose) for pose in (frame.pose, POSES[frame.number]))
        assert np.linalg.norm(own - own[0] - truth + truth[0], axis=1).mean() < 0.05


def test_who_decides_at_once_learns_from_every_frame():
    proposer = KnownPoses()
    found, _ = track(range(3), np.arange(3) / 10, smooth=False, proposer=proposer)
    assert [number for number, _ in proposer.learned] == [0, 1, 2]
    assert [notes for notes, _ in proposer.asked] == [[0], [1], [2]]
    for (_, joints), frame in zip(proposer.learned, found, strict=True):
        assert joints == pytest.approx(frame.joints[0], abs=0.02)  # joint centres lie beside
    later = KnownPoses()
    track(range(2), [0.0, 0.1], smooth=True, proposer=later)
    assert later.learned == []


def test_the_body_is_the_proposers():
    taller = BodyModel.from_sizes(BodySizes(1.80))
    _, tracked = track([0], [0.0], proposer=KnownPoses(taller))
    assert tracked.model is taller and tracked.tracker.surface.model is taller


def test_a_pending_frame_is_packed_and_seen_again():
    mask = silhouette(body(), POSES[0], camera_at((0, -4, 1.2), size=(323, 240)))
    crop = ColourCrop.of(np.zeros((4, 4, 3), np.uint8), (1, 2))
    frame = PendingFrame.of(7, 0.5, Person(mask, True, crop), "note")
    assert frame.bits.nbytes < mask.size / 7 and frame.person.mask.size == 0
    seen = frame.seen()
    assert (seen.mask == mask).all() and seen.cut and seen.colours is crop
