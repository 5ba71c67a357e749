"""Small pose libraries, with and without a proposal, for `benchmarks.fuzz_targets`."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.scene import ring
from calib.camera import Camera
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.dynamics import relaxed_rad
from silhouette_core.motion.keyposes.notation import movements
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.scoring.cpu import CpuBackend


def make_library(path: Path, model: BodyModel, *, learned: bool) -> None:
    """Writes a library of one movement of a body, with a proposal that learned nothing or none."""
    from silhouette_core.monocular.tree.base_poses import base_poses
    from silhouette_core.monocular.tree.build import build_library
    from silhouette_core.monocular.tree.pose_library import LibrarySettings
    from silhouette_core.monocular.tree.store import write_library

    settings = LibrarySettings(poses=60, yaw_step_deg=60, tolerance_deg=12.0, mirror=False)
    clips = {"wave": perform(movements()["wave"], model)}
    library = build_library(base_poses(clips, settings), model, settings)
    if learned:
        library = replace(library, proposal=unlearned_proposal())
    write_library(library, path)


@cache
def unlearned_proposal():
    """A proposal that learned nothing: whatever it sees, somebody stands there facing the camera,
    about as far away as assumed.
    """
    from silhouette_core.monocular.proposal import silhouette_features as features
    from silhouette_core.monocular.proposal.convolutional_encoder import ConvolutionalEncoder
    from silhouette_core.monocular.proposal.mixture_network import MixtureNetwork
    from silhouette_core.monocular.proposal.pose_proposal import PoseProposal, SilhouetteEncoding

    rng = np.random.default_rng(0)
    cells = features.FEET_GRID[0] * features.FEET_GRID[1]
    shape = cells, features.FEET_COMPONENTS
    feet = features.SilhouetteBasis(
        rng.random(cells, np.float32), rng.standard_normal(shape, np.float32) / 60
    )
    outline = ConvolutionalEncoder.initial(1, 4, features.OUTLINE_CODES, rng)
    inside = ConvolutionalEncoder.initial(2, 4, features.INSIDE_CODES, rng)
    encoding = SilhouetteEncoding(outline, feet, inside)
    model = BodyModel.from_sizes(BodySizes(1.75))
    standing = Pose(np.zeros(3), np.eye(3), relaxed_rad(model.tree))
    placed = landmarks(model, *place(model, *PoseArrays.from_poses([standing]).arrays))[0]
    joints = ((placed - placed[0])[1:] / model.length_m).astype(np.float32)
    inputs = features.network_inputs(
        _features(PoseProposal(encoding, None)),
        np.arange(2),
        np.zeros((2, 8), int),
        np.ones(2, bool),
    ).shape[1]
    network = MixtureNetwork.initial(inputs, 16, 1, 3, joints, rng)
    network.weights[-1][:] = 0
    return PoseProposal(encoding, network)


def _features(proposal):
    from silhouette_core.monocular.proposal.silhouette_features import FrameFeatures

    masks = np.zeros((2, 240, 320), bool)
    masks[:, 40:200, 140:180] = True
    zeros = np.zeros(2, np.float32)
    codes = proposal.codes(masks)
    return FrameFeatures(codes, zeros, zeros, np.zeros((2, 3), np.float32), np.array([0.0, 0.04]))


def use_library(path: Path) -> None:
    """Reads a library and works with it as `track` does."""
    from silhouette_core.monocular.tree.paper_filter import PaperFilter
    from silhouette_core.monocular.tree.sample_proposer import find_samples
    from silhouette_core.monocular.tree.store import read_library
    from silhouette_core.monocular.tree.summary import summary
    from silhouette_core.monocular.tree.transitions import transitions

    library = read_library(path)
    summary(library, path)
    library.pose(np.arange(min(len(library), 50)))
    library.render(np.arange(min(len(library), 2)))
    camera = ring(1, (320, 240)).cameras[0]
    camera = Camera("cam", camera.size, camera.matrix, np.zeros(0), np.eye(3), np.ones(3))
    mask = np.zeros((240, 320), bool)
    mask[40:200, 140:180] = True
    find_samples(library, camera, mask, CpuBackend()).poses([0])
    even = np.full(len(library), 1 / len(library))
    for aware in (False, True):
        tracker = PaperFilter(library, transitions(library, aware), camera, 4.0, even, CpuBackend())
        for time_s in (0.0, 0.1):
            tracker.step(time_s, mask).poses([0])
    if library.proposal is not None:
        library.proposal.modes([_features(library.proposal)])[0]
