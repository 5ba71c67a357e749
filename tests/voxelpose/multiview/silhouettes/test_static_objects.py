"""A chair beside the person: found, its pixels told, and a sitting pose found in spite of it."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    joint_errors_m,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.person.body_choice import find_sitting_pose
from voxelpose.multiview.proposers.pose_search import BodyGeometry, find_pose
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.static_objects import find_static_objects

SCENE = views(4)
VOLUME = VoxelGrid.from_bounds((-1.2, -1.2, -0.1), (1.2, 1.2, 2.1), 0.05)
MODEL, PERSON = fitting_model(), other_body()
SEAT_M = 0.45


def boxes(seat_m: float = SEAT_M) -> list[np.ndarray]:
    """Corners (8, 3) of a chair's seat, back and legs; its user faces -y."""
    spans = [((-0.22, 0.22), (-0.22, 0.22), (seat_m - 0.05, seat_m))]
    spans.append(((-0.22, 0.22), (0.20, 0.24), (seat_m + 0.1, seat_m + 0.45)))
    spans += [
        ((x - 0.02, x + 0.02), (y - 0.02, y + 0.02), (0.0, seat_m))
        for x in (-0.2, 0.2)
        for y in (-0.2, 0.2)
    ]
    return [np.array(np.meshgrid(*span)).reshape(3, 8).T for span in spans]


def furniture(corners: list[np.ndarray]) -> list[np.ndarray]:
    """Pixels (h, w) bool that boxes cover in every view."""
    masks = []
    for camera in SCENE.rig:
        mask = np.zeros(camera.size[::-1], np.uint8)
        for box in corners:
            seen = box @ camera.rotation.T + camera.translation
            pixels = (seen @ camera.matrix.T)[:, :2] / seen[:, 2:]
            outline = cv2.convexHull(np.rint(pixels).astype(np.int32))
            cv2.fillConvexPoly(mask, outline, 1)
        masks.append(mask > 0)
    return masks


def sitting(model, lift_deg: float) -> Pose:
    """Sits on the chair, one arm raised."""
    legs = {f"{side}_thigh.flexion": 88.0 for side in ("left", "right")}
    legs |= {f"{side}_shin.flexion": 85.0 for side in ("left", "right")}
    pose = stance(model, legs | {"left_upper_arm.abduction": lift_deg})
    return Pose(np.array([0.0, 0.0, SEAT_M + 0.1]), pose.root_rotation, pose.angles_rad)


def filmed(poses: list[Pose], model, objects: list[np.ndarray]) -> MaskStore:
    store = MaskStore([camera.size for camera in SCENE.rig], len(poses))
    for t, pose in enumerate(poses):
        body = photograph(SCENE, model, pose)
        store.put(t, [mask | thing for mask, thing in zip(body, objects, strict=True)])
    return store


@pytest.fixture(scope="module")
def poses() -> list[Pose]:
    return [sitting(MODEL, lift_deg) for lift_deg in np.linspace(20, 90, 8)]


@pytest.fixture(scope="module")
def observer() -> HullObserver:
    return HullObserver(SCENE, VOLUME, 0.03, body_rule(4, 0))


def test_a_chair_is_found_with_the_pixels_that_it_covers(poses, observer):
    things = furniture(boxes())
    found = find_static_objects(MODEL, poses, filmed(poses, MODEL, things), observer)
    assert found is not None and not found.apart
    body = photograph(SCENE, MODEL, poses[0])
    for hidden, thing, mask in zip(found.pixels, things, body, strict=True):
        beside = thing & ~mask
        assert np.count_nonzero(hidden & beside) > 0.9 * np.count_nonzero(beside)
        alone = mask & ~thing
        assert np.count_nonzero(hidden & alone) < 0.1 * np.count_nonzero(alone)


def test_what_stands_at_a_distance_is_apart(observer):
    upright = [stance(MODEL, {"left_upper_arm.abduction": lift}) for lift in (20.0, 50.0, 80.0)]
    for away, apart in ((0.3, False), (0.75, True)):
        things = furniture([box + np.array([0.0, away, 0.0]) for box in boxes()])
        found = find_static_objects(MODEL, upright, filmed(upright, MODEL, things), observer)
        assert found is not None and found.apart == apart


def test_somebody_who_stands_still_is_not_set_aside_as_an_object(observer):
    """The body was taken for a small thing's that lies on the floor."""
    lying = stance(MODEL)
    things = [
        Pose(np.array([x, 0.0, 0.1]), lying.root_rotation, lying.angles_rad)
        for x in (0.9, 0.8, 0.7)
    ]
    small = BodyModel.from_sizes(BodySizes(0.6))
    still = photograph(SCENE, PERSON, stance(PERSON, None, (-0.6, 0.0)))
    found = find_static_objects(small, things, filmed(things, small, still), observer)
    assert found is not None and not found.apart


@pytest.mark.parametrize("count", [1, 3])
def test_while_nothing_moves_nothing_is_known_to_be_static(poses, observer, count):
    still = [poses[0]] * count
    store = filmed(still, MODEL, furniture(boxes()))
    for behind in (False, True):
        assert find_static_objects(MODEL, still, store, observer, behind=behind) is None


def test_without_a_chair_nothing_is_found(poses, observer):
    nothing = [np.zeros(camera.size[::-1], bool) for camera in SCENE.rig]
    assert find_static_objects(MODEL, poses, filmed(poses, MODEL, nothing), observer) is None


def test_what_moves_is_no_object(poses, observer):
    store = MaskStore([camera.size for camera in SCENE.rig], len(poses))
    for t, pose in enumerate(poses):
        turned = Rotation.from_euler("z", 12 * t, degrees=True).as_matrix().T
        things = furniture([(box + np.array([0.5, 0, 0])) @ turned for box in boxes()])
        body = photograph(SCENE, MODEL, pose)
        store.put(t, [mask | thing for mask, thing in zip(body, things, strict=True)])
    assert find_static_objects(MODEL, poses, store, observer) is None


@pytest.mark.slow
def test_legs_are_found_on_the_legs_and_not_on_the_chair():
    truth = sitting(PERSON, 60.0)
    silhouettes = [
        mask | thing
        for mask, thing in zip(photograph(SCENE, PERSON, truth), furniture(boxes()), strict=True)
    ]
    observer = HullObserver(SCENE, VOLUME, 0.03, CarveRule())
    frame = observer.observe(silhouettes)
    assert frame is not None
    body = BodyGeometry.from_model(MODEL, 0.03, "cpu")
    error_m = joint_errors_m(MODEL, find_sitting_pose(body, frame)[0].pose, PERSON, truth)
    usual_m = joint_errors_m(MODEL, find_pose(body, frame)[0].pose, PERSON, truth)
    assert error_m.mean() < min(0.08, usual_m.mean() + 0.01)
