"""Joints of virtual people as a pose network sees them."""

import numpy as np

from silhouette_core.image.seen_joints import deviations_m
from silhouette_core.monocular.making.virtual_defects import seen_errors, virtual_seen_joints


def takes(count=80):
    places = np.zeros((90, 15, 2))
    return np.array([virtual_seen_joints(places, np.random.default_rng(k)) for k in range(count)])


def test_they_are_off_by_what_was_measured():
    codes = takes()
    codes = codes[(codes != 0).any(axis=2)]
    off_mm = 1750 * codes[..., :30].reshape(-1, 15, 2) / 3
    visible = codes[..., 30:].reshape(-1, 15)
    stated_mm = np.hypot(1000 * deviations_m(visible), seen_errors()[5])
    # Half of two normal errors are within 1.18 deviations, which vary here from take to take.
    share = np.linalg.norm(off_mm, axis=-1) < 1.18 * stated_mm
    assert (np.abs(share.mean(axis=0) - 0.5) < 0.12).all()


def test_a_joint_errs_alike_in_neighbouring_frames_and_a_share_of_it_in_all():
    off = takes()[:, :, :30]
    off = off[np.abs(off).max(axis=(1, 2)) > 0]

    def alike(lag):
        return (off[:, lag:] * off[:, :-lag]).mean() / np.square(off).mean()

    assert alike(1) > 0.7 > alike(4) > alike(30) > 0.1


def test_nobody_is_seen_at_times():
    lost = (takes() == 0).all(axis=2)
    assert 0.1 < lost.any(axis=1).mean() < 0.4 and 0.01 < lost.mean() < 0.2
