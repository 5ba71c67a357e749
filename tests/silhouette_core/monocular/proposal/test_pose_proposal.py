"""Proposals as they are used and stored; what they have learned is tested elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.monocular.proposal.convolutional_encoder import ConvolutionalEncoder
from silhouette_core.monocular.proposal.mixture_network import MixtureNetwork
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal, SilhouetteEncoding
from silhouette_core.monocular.proposal.silhouette_features import (
    FEET_GRID,
    GRID,
    OFFSETS_S,
    SEEN_CODES,
    STATURE_CELLS,
    FrameFeatures,
    SilhouetteBasis,
    SilhouetteCodes,
    coverage_grid,
    feet_grid,
    fit_basis,
    mirrored_seen_codes,
    nearby_frames,
    network_inputs,
    seen_codes,
    shading_grid,
)
from silhouette_core.monocular.tree.rendering import STATURE_PX, WINDOW_PX, silhouette_levels
from silhouette_core.monocular.tree.store import read_library, write_library
from tests.silhouette_core.monocular.tree.small_library import small_library


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def features(rng, count=40, fps=30.0):
    return FrameFeatures(
        SilhouetteCodes(
            *(rng.normal(size=(count, k)).astype(np.float32) for k in (128, 48, 96)),
            coloured=np.arange(count) % 3 > 0,
            joints=rng.normal(size=(count, SEEN_CODES)).astype(np.float32),
        ),
        rng.uniform(-0.2, 0.5, count),
        rng.uniform(-3, 3, count),
        rng.normal(size=(count, 3)),
        5 + np.arange(count) / fps,
    )


@pytest.fixture
def proposal(rng):
    """Untrained."""
    mean = rng.normal(size=(14, 3)).astype(np.float32)
    inputs = network_inputs(features(rng, 1), np.arange(1), np.zeros((1, 8), int), np.ones(1, bool))
    cells = FEET_GRID[0] * FEET_GRID[1]
    feet = SilhouetteBasis(
        np.zeros(cells, np.float32), rng.normal(size=(cells, 48)).astype(np.float32)
    )
    outline, inside = (
        ConvolutionalEncoder.initial(channels, 4, codes, rng)
        for channels, codes in ((1, 128), (2, 96))
    )
    network = MixtureNetwork.initial(inputs.shape[1], 64, 1, 4, mean, rng)
    network.weights[-1][:] *= 3
    return PoseProposal(SilhouetteEncoding(outline, feet, inside), network)


def test_modes_have_the_pelvis_at_the_origin(proposal, rng):
    modes = proposal.modes([features(rng)])[0]
    assert modes.joints.shape == (40, 4, 15, 3) and modes.sigma.shape == (40, 4, 15, 2)
    assert modes.offset.shape == modes.offset_sigma.shape == (40, 3) and len(modes.joints) == 40
    assert not modes.joints[:, :, 0].any() and not modes.sigma[:, :, 0].any()
    assert (modes.sigma[:, :, 1:] > 0).all() and (modes.offset_sigma > 0).all()
    np.testing.assert_allclose(modes.probability.sum(axis=1), 1, rtol=1e-5)


@pytest.mark.parametrize("causal", [True, False])
def test_causal_modes_do_not_read_later_frames(proposal, rng, causal):
    before = features(rng)
    after = features(rng)
    late = np.arange(len(before)) > 20
    rows = np.where(late, 40, 0) + np.arange(40)
    mixed = FrameFeatures(
        SilhouetteCodes.joined([before.codes, after.codes])[rows],
        *(
            np.concatenate([getattr(before, name), getattr(after, name)])[rows]
            for name in ("pitch_rad", "heading_rad", "anchor")
        ),
        before.time_s + 0.013 * late,
    )
    one, other = proposal.modes([before], causal)[0], proposal.modes([mixed], causal)[0]
    for name in ("probability", "joints", "sigma", "offset", "offset_sigma"):
        same = (getattr(one, name) == getattr(other, name)).reshape(40, -1).all(axis=1)
        assert same[:21].all() if causal else same[:9].all() and not same[9:].any()


def test_several_sequences_are_read_like_each_alone(proposal, rng):
    one, other = features(rng), features(rng)
    frames = np.array([3, 39])
    for alone, together in zip(
        [proposal.modes([seen], True, frames)[0] for seen in (one, other)],
        proposal.modes([one, other], True, frames),
        strict=True,
    ):
        np.testing.assert_allclose(together.joints, alone.joints, rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(together.probability, alone.probability, rtol=1e-3, atol=1e-6)


def test_what_learned_before_joints_were_read_goes_on_without_them(proposal, rng):
    arrays = proposal.arrays()
    arrays["weight0"] = arrays["weight0"][: -9 * SEEN_CODES]
    before, seen = PoseProposal.from_arrays(arrays), features(rng)
    blind = replace(seen, codes=replace(seen.codes, joints=np.zeros_like(seen.codes.joints)))
    one, other = before.modes([seen])[0], proposal.modes([blind])[0]
    np.testing.assert_array_equal(one.joints, other.joints)
    assert not np.allclose(one.joints, proposal.modes([seen])[0].joints)


def test_joints_in_a_mirror_are_those_of_the_other_side(rng):
    places, visibility = rng.normal(size=(3, 15, 2)), rng.uniform(size=(3, 15))
    codes = mirrored_seen_codes(seen_codes(places, visibility))
    left, right = (LANDMARK_NAMES.index(f"{side}_wrist") for side in ("left", "right"))
    places[..., 0] *= -1
    np.testing.assert_allclose(codes[:, 2 * left : 2 * left + 2], 3 * places[:, right], rtol=1e-6)
    np.testing.assert_allclose(codes[:, 30 + right], visibility[:, left], rtol=1e-6)
    assert (codes[:, :2] == (3 * places[:, 0]).astype(np.float32)).all()


@pytest.mark.parametrize("fps", [30, 60, 120])
def test_instants_are_the_same_at_any_frame_rate(fps):
    time = np.arange(2 * fps) / fps
    nearby = nearby_frames(time)
    inner = slice(fps // 2, -fps // 2)
    np.testing.assert_allclose(
        time[nearby[inner]] - time[inner, None], np.tile(OFFSETS_S, (fps, 1)), atol=1e-9
    )
    assert nearby[0, :4].tolist() == [0] * 4 and nearby[-1, 4:].tolist() == [len(time) - 1] * 4


@pytest.mark.parametrize("fps", [5, 10, 25, 30, 240])
def test_instants_lie_on_their_side_of_the_frame_even_if_frames_are_missing(fps, rng):
    time = np.sort(rng.permutation(np.arange(60))[:40]) / fps
    nearby, own = nearby_frames(time), np.arange(40)[:, None]
    assert (nearby[:, :4] <= own).all() and (nearby[:, 4:] >= own).all()
    wanted = time[:, None] + OFFSETS_S
    best = np.abs(time - wanted[..., None]).min(axis=-1)
    np.testing.assert_allclose(np.abs(time[nearby] - wanted), best, atol=1e-12)
    assert nearby_frames(np.array([3.0])).tolist() == [[0] * 8]


def test_turning_the_world_changes_nothing(proposal, rng):
    given, turn = features(rng), 0.7
    c, s = np.cos(turn), np.sin(turn)
    turned = replace(
        given,
        heading_rad=given.heading_rad + turn,
        anchor=given.anchor @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + (1, 2, 0),
    )
    np.testing.assert_allclose(
        proposal.modes([turned])[0].joints, proposal.modes([given])[0].joints, atol=1e-4
    )


def test_wrong_features_are_refused(rng):
    given = features(rng)
    with pytest.raises(ValueError, match="time_s must increase"):
        replace(given, time_s=given.time_s[::-1])
    with pytest.raises(ValueError, match=r"anchor must be \(40, 3\)"):
        replace(given, anchor=given.anchor[:5])
    with pytest.raises(ValueError, match=r"pitch_rad must be \(40,\) finite"):
        replace(given, pitch_rad=np.full(40, np.nan))


def test_the_grid_is_that_of_the_library(rng):
    masks = rng.random((3, *WINDOW_PX[::-1])) < 0.5
    middle = silhouette_levels(masks)[1]
    blocks = middle.reshape(3, GRID[0], 2, GRID[1], 2).sum(axis=(2, 4))
    assert (coverage_grid(masks) == blocks).all()
    assert (coverage_grid(masks[0]) == blocks[0]).all()
    assert STATURE_CELLS * WINDOW_PX[0] / GRID[1] == STATURE_PX
    with pytest.raises(TypeError, match="masks must be"):
        coverage_grid(masks.astype(np.uint8))


def test_the_basis_is_that_of_a_singular_value_decomposition(rng):
    few = rng.normal(size=(20, FEET_GRID[0] * FEET_GRID[1])) * 0.02
    weights = rng.normal(size=(200, 20)) * np.linspace(5, 1, 20)
    grids = np.clip(np.round(2 + weights @ few), 0, 4).astype(np.uint8).reshape(-1, *FEET_GRID)
    found = fit_basis(grids, 40)
    mean, basis = found.mean, found.components
    rows = grids.reshape(len(grids), -1) / 4
    np.testing.assert_allclose(mean, rows.mean(axis=0), atol=1e-6)
    _, values, directions = np.linalg.svd(rows - rows.mean(axis=0), full_matrices=False)
    cosines = directions[:10] @ (basis / np.linalg.norm(basis, axis=0))[:, :10]
    np.testing.assert_allclose(np.abs(np.diag(cosines)), 1, atol=0.02)
    spread = found.encode(grids).std(axis=0)[:10]
    np.testing.assert_allclose(spread, np.sqrt(values[:10] / values[0]), rtol=0.02)


def test_the_lowest_part_ends_with_the_lowest_pixel(rng):
    masks = np.zeros((3, 120, 160), bool)
    masks[0, 20:90, 60:80] = masks[0, 88:90, 55:85] = True
    masks[1, :10, :5] = True
    grids = feet_grid(masks)
    assert grids.shape == (3, *FEET_GRID) and not grids[2].any()
    assert grids[0].sum() == 4 * masks[0, 62:90].sum() and (grids[0, -1] > 0).sum() == 30
    assert grids[1].sum() == 4 * 50 and grids[1, -1].any() and not grids[1, :18].any()


def test_colours_are_read_only_where_they_are_known(proposal, rng):
    given = features(rng)
    plain = replace(given, codes=replace(given.codes, inside=given.codes.inside * 2))
    one, other = proposal.modes([given])[0].joints, proposal.modes([plain])[0].joints
    same = (one == other).reshape(40, -1).all(axis=1)
    assert (same == ~given.codes.coloured).all()


def test_shading_is_neutral_outside_and_bounded():
    grid = shading_grid(np.array([0.0, 4.0, -4.0, 4e-2, 40.0, -40.0]))
    assert grid.tolist() == [32, 64, 0, 32, 64, 0] and grid.dtype == np.uint8
    assert shading_grid(np.array([4 / 48]))[0] == 33


@pytest.fixture(scope="module")
def library():
    return small_library(poses=60)


def test_a_library_keeps_its_proposal(library, proposal, tmp_path, rng):
    path = tmp_path / "me.vplib"
    write_library(replace(library, proposal=proposal), path)
    read = read_library(path)
    assert read.proposal is not None
    arrays = read.proposal.arrays()
    for name, array in proposal.arrays().items():
        assert (arrays[name] == array).all() and arrays[name].dtype == array.dtype
    given = features(rng)
    assert (read.proposal.modes([given])[0].joints == proposal.modes([given])[0].joints).all()


def test_a_library_without_one_has_none(library, tmp_path):
    write_library(library, tmp_path / "me.vplib")
    assert read_library(tmp_path / "me.vplib").proposal is None


def test_arrays_that_do_not_fit_together_are_refused(library, proposal, tmp_path):
    arrays = proposal.arrays()
    names = "outline_weight3", "outline_bias0", "inside_weight0", "inside_bias2", "feet_basis"
    for name in ("weight1", "bias0", "bias2", "mean_feet", "mean_joints", *names):
        with pytest.raises(ValueError, match=r"proposal\.\w+ must be"):
            PoseProposal.from_arrays(arrays | {name: arrays[name][:-1]})
    for names in (("inside_weight0",), ("weight3", "bias3")):  # as they once were
        few = {name: array for name, array in arrays.items() if name not in names}
        with pytest.raises(ValueError, match="an earlier version"):
            PoseProposal.from_arrays(few)
    feet = proposal.encoding.feet
    cut = replace(proposal.encoding, feet=replace(feet, components=feet.components[:-1]))
    broken = replace(proposal, encoding=cut)
    write_library(replace(library, proposal=broken), tmp_path / "me.vplib")
    with pytest.raises(InputError, match=r"proposal\.\w+ must be"):
        read_library(tmp_path / "me.vplib")
