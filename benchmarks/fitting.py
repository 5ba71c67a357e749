"""A whole step of `fit`, silhouettes to pose, against one carve of Open3D."""

from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.carving import open3d_carve
from benchmarks.cases import Case, Timed, case
from benchmarks.scene import ring
from calib.camera import Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.image.raster import render_parts
from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.proposers.pose_search import BodyGeometry
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tracking.tracking import PoseTracker

VIEWS, SHAPE_SEED = 4, 5
VOXEL_M = 0.025


def film() -> tuple[Rig, list[list[NDArray[np.bool_]]], list[Pose]]:
    """Returns four cameras, the silhouettes of three frames of somebody else's body walking, and
    the poses.
    """
    rig = ring(VIEWS)
    random = np.random.default_rng(SHAPE_SEED)
    other = BodyModel.from_sizes(BodySizes(1.75)).reshaped(
        0.7 * SHAPE_SIGMA * random.standard_normal(len(SHAPE_SIGMA))
    )
    poses, frames = [], []
    for t in range(3):
        angles = RELAXED_RAD.copy()
        for name, speed in (
            ("left_thigh.flexion", 0.10),
            ("right_thigh.flexion", -0.10),
            ("left_shin.flexion", 0.12),
        ):
            angles[other.tree.dof_names.index(name)] += speed * (t + 1)
        poses.append(Pose(np.array([0.0, -0.03 * t, 0.95]), np.eye(3), angles))
        vertices = posed_mesh(other, poses[-1])
        drawn = [
            render_parts(
                vertices @ c.rotation.T + c.translation,
                other.faces,
                other.face_part,
                c.matrix,
                c.size,
            )[0]
            > 0
            for c in rig
        ]
        frames.append(drawn)
    return rig, frames, poses


@case("fit step, 4 cameras")
def against_one_carve() -> Case:
    rig, frames, poses = film()
    store = MaskStore([camera.size for camera in rig], len(frames))
    for t, masks in enumerate(frames):
        store.put(t, masks)
    observer = HullObserver(
        PinholeViews.from_rig(rig),
        VoxelGrid(np.array([-1.0, -1.0, -0.1]), 2 * VOXEL_M, (40, 40, 44)),
        VOXEL_M,
    )
    surface = Surface(BodyModel.from_sizes(BodySizes(1.75)))
    track = PoseTracker(
        BodyGeometry.from_surface(surface, VOXEL_M, "cpu"),
        ObservationStore(observer, store),
        30.0,
        MatchSettings(),
        lambda stage: nullcontext(),
        lambda: None,
    )

    def forget() -> None:
        track.poses[:], track.error[:] = [poses[0], poses[1], None], [0.0, 0.0, np.inf]
        track.error[:2] = 0.1
        track.observations = ObservationStore(observer, store)

    def step(_: None) -> Pose | None:
        track.carry(1)  # the frame before, too
        return track.poses[2]

    def check(found: Pose | None, _: Any) -> str:
        if found is None:
            return "no pose was found"
        off = np.linalg.norm(found.root_m - poses[2].root_m)
        return f"the pelvis is {100 * off:.0f} cm off" if off > 0.08 else ""

    whole = VoxelGrid(np.array([-1.0, -1.0, -0.1]), 2.0 / 128, (128, 128, 128))
    return Case(
        Timed(step, forget, 5),
        open3d_carve(rig, frames[2], whole),
        "one open3d carve, 128^3 x 4",
        check,
        3,
        "above 1",
    )
