"""Two people who stand near to each other, in single frames: `python -m benchmarks.near_people
[--cameras 4] [--count 30] [--seed 1]`.

Two bodies in poses of the program's movements, 0.4 to 0.7 m apart. A third body is matched to each
from its true torso, by the voxels: alone on the voxels of both; both together, interfering parts
decided at once or one after the other; and alone on its own silhouettes, as `fit` begins. Prints
the error of the joints relative to the pelvis, mm, and how many are over 100 mm off.
"""

import argparse
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.keyposes.perform import keypose_motions
from silhouette_core.motion.kinematics import joints_of, rotation_matrices
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import fitting_model, other_body, photograph, views
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver, body_rule, widened
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.matcher import Match, MatchSettings, match, match_together
from voxelpose.multiview.people.own_silhouettes import hull_pieces, own_and_unknown
from voxelpose.multiview.tuning import CARVING

_WRONG_MM = 100


def stance(motions: Sequence[Motion], place_m: NDArray, rng: np.random.Generator) -> Pose:
    """A pose of some motion at a place (2,), turned anyhow."""
    motion = motions[int(rng.integers(len(motions)))]
    row = int(rng.integers(len(motion)))
    turn = Rotation.from_euler("z", rng.uniform(0, 360), degrees=True).as_matrix()
    rotation = turn @ rotation_matrices(motion.root_quaternion[row : row + 1])[0]
    return Pose(np.append(place_m, motion.root_m[row, 2]), rotation, motion.angles_rad[row])


def off_mm(model: BodyModel, found: Match, true_m: NDArray) -> float:
    """Mean error of the joints relative to the pelvis."""
    joints = joints_of(model, [found.pose])[0]
    off = (joints - joints[0]) - (true_m - true_m[0])
    return 1000 * float(np.linalg.norm(off, axis=1).mean())


def main() -> None:
    """Draws stances, matches and prints."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--cameras", type=int, default=4)
    words.add_argument("--count", type=int, default=30)
    words.add_argument("--seed", type=int, default=1)
    given = words.parse_args()
    rng, seen_by = np.random.default_rng(given.seed), views(given.cameras)
    model = fitting_model()
    volume = BodyVolume.from_model(model, CARVING.voxel_m, "cpu")
    bodies, motions = (other_body(3), other_body(4, "male")), [*keypose_motions(model).values()]
    grid = VoxelGrid.from_bounds((-1.5, -1.5, -0.05), (1.5, 1.5, 2.3), CARVING.voxel_m)
    observer = HullObserver(seen_by, grid, CARVING.voxel_m, body_rule(given.cameras, 0))
    rows: list[list[float]] = []
    ways: dict[str, list[Match]] = {}
    shared = 0
    for _ in range(given.count):
        away, angle = rng.uniform(0.2, 0.35), rng.uniform(0, 2 * np.pi)
        place_m = away * np.array([np.cos(angle), np.sin(angle)])
        poses = [stance(motions, side * place_m, rng) for side in (-1, 1)]
        people = [photograph(seen_by, *one) for one in zip(bodies, poses, strict=True)]
        masks = [a | b for a, b in zip(*people, strict=True)]
        hull = carve(seen_by.rig, widened(seen_by, masks, grid), grid, observer.rule)
        begun = [Pose(pose.root_m, pose.root_rotation, RELAXED_RAD.copy()) for pose in poses]
        starts = [(volume, pose) for pose in begun]
        together = match_together(starts, grid, hull)
        pieces = hull_pieces(masks, np.array([pose.root_m[:2] for pose in poses]), observer)
        apart = []
        for k, pose in enumerate(begun):
            own, unknown = own_and_unknown(masks, pieces, k, bodies=False)
            frame = observer.with_unknown(unknown).observe(own, pose.root_m)
            assert frame is not None, "somebody stands there"
            apart.append(match(volume, frame.grid, frame.occupancy, pose))
        ways = {
            "alone, on the voxels of both": [match(volume, grid, hull, pose) for pose in begun],
            "together, interfering parts at once": together,
            "together, one by one": match_together(
                starts, grid, hull, MatchSettings(interference=False)
            ),
            "alone, on the own silhouettes": apart,
        }
        true = [joints_of(body, [pose])[0] for body, pose in zip(bodies, poses, strict=True)]
        for k in range(2):
            rows.append([off_mm(model, found[k], true[k]) for found in ways.values()])
        shared += any(" of " in name for group in together[0].groups for name in group)
    print(f"parts of both interfere in {shared} of {given.count} stances")
    for name, errors in zip(ways, np.array(rows).T, strict=True):
        print(f"{name:<36}{errors.mean():>7.1f} mm{(errors > _WRONG_MM).sum():>4} of {len(rows)}")


if __name__ == "__main__":
    main()
