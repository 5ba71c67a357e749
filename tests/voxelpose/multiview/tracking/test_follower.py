import pickle
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.follower import AtOnce
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.estimator import Settings
from silhouette_core.image.cleanup import dilated
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.cpu import CpuBackend
from tests.voxelpose.multiview.matching_scenes import (
    STATURE_M,
    joint_errors_m,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.tracking.body_track import BodyTrack, Moment
from voxelpose.multiview.tracking.follower import PoseFollower, adapt_body, catch_up, search

SEEN_BY = views(4)
PERSON = other_body(template="male")
KNOWN = Settings(stature_m=STATURE_M)
_TRUNK = ("trunk_width", "trunk_depth")


def walking(frame: int) -> Pose:
    """Walks to the left at 1.2 m/s, swinging the arms, and bends one of them."""
    swing = 30 * np.sin(0.2 * frame)
    turns = {
        "left_upper_arm.forward": swing,
        "right_upper_arm.forward": -swing,
        "left_thigh.flexion": -0.8 * swing + 10,
        "right_thigh.flexion": 0.8 * swing + 10,
        "right_forearm.flexion": 30 + frame,
    }
    return stance(PERSON, turns, (0.04 * frame - 0.4, 0.0))


def masks_of(pose: Pose, cameras: slice = slice(None)) -> dict[str, np.ndarray]:
    """Silhouettes by camera name."""
    pictures = photograph(SEEN_BY, PERSON, pose)
    return dict(zip(SEEN_BY.rig.names[cameras], pictures[cameras], strict=True))


def nobody() -> dict[str, np.ndarray]:
    """Empty silhouettes."""
    return {camera.name: np.zeros(camera.size[::-1], bool) for camera in SEEN_BY.rig}


@pytest.fixture(scope="module")
def found() -> BodyTrack:
    """What a search finds in the first frame."""
    track = search(SEEN_BY.rig, KNOWN, None, Moment.of(0.0, masks_of(walking(0))), 4)
    assert track is not None
    return track


@pytest.fixture
def follower() -> PoseFollower:
    return PoseFollower(SEEN_BY.rig, KNOWN, AtOnce())


def error_mm(follower: PoseFollower, pose: Pose, truth: Pose) -> float:
    """Mean joint error."""
    assert follower.body is not None
    return 1000 * float(joint_errors_m(follower.body.model, pose, PERSON, truth).mean())


def test_bodies_are_scored_by_the_backend_of_the_settings(found, monkeypatch):
    """Of whatever a search begins with, also in other processes, where the name alone arrives."""
    names = []
    module = "voxelpose.multiview.matching.body_volume.load_backend"
    monkeypatch.setattr(module, lambda name: names.append(name) or CpuBackend())
    settings, moment = replace(KNOWN, backend="another"), Moment.of(0.0, masks_of(walking(0)))
    searched = search(SEEN_BY.rig, settings, None, moment, 1)
    adapted = adapt_body(SEEN_BY.rig, settings, found, [(moment, found.fit.pose)])
    sent = pickle.loads(pickle.dumps(adapted)).body.body_volume
    assert sent.backend_name == "another" and isinstance(sent.backend, CpuBackend)
    assert searched is not None and set(names) == {"another"}


@pytest.mark.slow
def test_a_walker_is_followed_though_a_camera_is_missing_for_a_while(follower):
    errors = []
    for frame in range(14):
        cameras = slice(0, 3) if 5 <= frame < 10 else slice(None)
        fit = follower.step(Moment.of(frame / 30, masks_of(walking(frame), cameras)))
        if frame > 1:
            assert fit is not None
            errors.append(error_mm(follower, fit.pose, walking(frame)))
    assert np.median(errors) < 45 and errors[-1] < 60


@pytest.mark.slow
def test_a_person_who_left_is_found_again(follower):
    for frame in range(3):
        follower.step(Moment.of(frame / 30, masks_of(walking(frame))))
    assert follower.body is not None
    assert follower.step(Moment.of(0.1, nobody())) is None
    assert follower.body is None
    for frame in range(20, 23):
        fit = follower.step(Moment.of(2 + frame / 30, masks_of(walking(frame))))
    assert fit is not None
    assert error_mm(follower, fit.pose, walking(22)) < 60


@pytest.mark.slow
def test_slow_cameras_are_followed_too(follower):
    """More than half a second between two frames, after which a track is usually given up."""
    for frame in range(4):
        fit = follower.step(Moment.of(0.6 * frame, masks_of(walking(3 * frame))))
    assert fit is not None
    assert error_mm(follower, fit.pose, walking(9)) < 100


class Slow(AtOnce):
    """Hands over what is submitted when so many further frames have come."""

    def __init__(self, frames: int):
        self._frames, self._waiting = frames, []

    def submit(self, fn, /, *args, **kwargs):
        done, future = super().submit(fn, *args, **kwargs), Future()
        self._waiting.append([self._frames, done, future])
        return future

    def next_frame(self) -> None:
        for entry in self._waiting:
            entry[0] -= 1
            if entry[0] == 0:
                entry[2].set_result(entry[1].result())


@pytest.mark.slow
def test_two_pictures_a_second_are_enough_though_a_search_takes_two_seconds():
    """The person has gone 0.6 m at each picture, and is elsewhere when the search is done."""
    executor = Slow(4)
    follower = PoseFollower(SEEN_BY.rig, KNOWN, executor)
    fits = []
    for number, frame in enumerate((0, 15, 30, 15) * 2):
        executor.next_frame()
        fits.append(follower.step(Moment.of(number / 2, masks_of(walking(frame)))))
    assert fits[3] is None  # not yet
    assert all(fit is not None for fit in fits[4:])
    assert error_mm(follower, fits[-1].pose, walking(15)) < 100


def test_nobody_is_not_searched_for(follower):
    class Refusing(AtOnce):
        def submit(self, fn, /, *args, **kwargs):
            raise AssertionError("a search for nobody")

    follower._executor = Refusing()
    assert follower.step(Moment.of(0.0, nobody())) is None


@pytest.mark.slow
def test_what_is_found_late_catches_up(found):
    """The search took 10 frames, in which the person has walked 0.4 m."""
    later = [Moment.of(k / 30, masks_of(walking(k))) for k in range(1, 11)]
    track = catch_up(SEEN_BY.rig, found, later)
    assert track is not None
    assert track.time_s == pytest.approx(10 / 30)
    offset = np.linalg.norm(track.fit.pose.root_m - walking(10).root_m)
    assert offset < 0.05
    assert catch_up(SEEN_BY.rig, found, [Moment.of(0.1, nobody())]) is None


@pytest.mark.slow
def test_the_hull_tells_a_stout_person():
    girths = [axis.along == "girth" or axis.name in _TRUNK for axis in SHAPE_AXES]
    stout = PERSON.reshaped(PERSON.shape + 0.3 * np.array(girths))
    pictures = photograph(SEEN_BY, stout, stance(stout))
    masks = dict(zip(SEEN_BY.rig.names, pictures, strict=True))
    slim, found = (
        search(SEEN_BY.rig, KNOWN, None, Moment.of(0.0, seen), 3)
        for seen in (masks_of(stance(PERSON)), masks)
    )
    assert slim is not None
    assert found is not None
    volumes = [one.body.model.part_volumes_m3(0.02).sum() for one in (slim, found)]
    assert volumes[1] > 1.15 * volumes[0]


def test_a_moment_keeps_silhouettes():
    masks = masks_of(walking(0))
    hidden = {name: np.roll(mask, 20, axis=1) for name, mask in masks.items()}
    alone, beside = Moment.of(0.0, masks), Moment.of(0.0, masks, hidden)
    for name, mask in masks.items():
        assert np.array_equal(alone.masks()[name], mask)
    assert alone.views(SEEN_BY.rig).unknown is None
    unknown = beside.views(SEEN_BY.rig).unknown
    assert unknown is not None
    assert all(np.array_equal(*pair) for pair in zip(unknown, hidden.values(), strict=True))


@pytest.mark.slow
def test_what_stays_wrong_is_given_up(found):
    """Somebody in a wide coat stands where the body was found."""
    coat = {name: dilated(mask, 7) for name, mask in masks_of(walking(0)).items()}
    later = [Moment.of(0.1 * k, coat) for k in range(1, 12)]
    assert catch_up(SEEN_BY.rig, found, later[:3]) is not None
    assert catch_up(SEEN_BY.rig, found, later) is None
