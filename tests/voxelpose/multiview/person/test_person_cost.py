"""Terms of a person's cost: what each says alone, and what outweighs what."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA
from silhouette_core.refinement.adaptation import Stature
from voxelpose.multiview.person.posterior import (
    Candidate,
    ShapePrior,
    StatureEvidence,
    cost_terms,
    is_improbable,
)

ADULT, USUAL = Candidate(1.70, None, "male"), [0.08] * 5
UNKNOWN = StatureEvidence(None, (1.70, 1.70))


def terms(candidate=ADULT, errors=USUAL, evidence=UNKNOWN, deviation=0.0):
    """Terms of a candidate whose shape deviates by a number of standard deviations."""
    model = BodyModel.from_sizes(candidate.sizes)
    expected = model.shape - deviation * SHAPE_SIGMA
    prior = ShapePrior(Stature(1.7, 0.05), expected, np.diag(SHAPE_SIGMA**2))
    return cost_terms(candidate, model, prior, errors, evidence)


def test_an_error_twice_as_large_costs_the_residuals_of_all_frames():
    assert terms()["silhouettes"] == pytest.approx(0)
    assert terms(errors=[0.16] * 5)["silhouettes"] == pytest.approx(8 * 5 * np.log(2))
    one_lost = terms(errors=[*USUAL[1:], np.inf])["silhouettes"]
    assert one_lost == pytest.approx(8 * np.log(1 / 0.08))


def test_errors_of_two_sigma_over_the_usual_one_are_improbable():
    assert terms(errors=[0.08 * np.exp(0.6)] * 3)["noise"] == pytest.approx(2)
    assert not is_improbable([0.145] * 5)
    assert is_improbable([0.147] * 5)
    assert not is_improbable([0.05] * 5)


def test_a_shape_costs_half_the_square_of_its_deviations():
    assert terms()["shape"] == 0
    assert terms(deviation=2.0)["shape"] == pytest.approx(2 * len(SHAPE_SIGMA))


def test_statures_are_an_adults_or_what_was_told():
    child, told = Candidate(1.34, None, "male"), StatureEvidence(1.70)
    assert terms(child)["stature"] == pytest.approx(4.5, rel=0.02)
    assert terms(child, evidence=told)["stature"] == pytest.approx(0.5 * 60**2, rel=0.02)
    assert terms(child, evidence=told)["hull"] == 0


def test_a_hull_tells_its_height_and_nothing_of_who_crouches_or_sits():
    assert terms()["hull"] == pytest.approx(-4.5, abs=0.01)
    far = terms(evidence=StatureEvidence(None, (0.9, 1.0)))["hull"]
    assert far == terms(replace(ADULT, posture="sitting"))["hull"] == 0
    near = terms(evidence=StatureEvidence(None, (1.2, 1.70 * np.exp(0.1))))["hull"]
    assert near == pytest.approx(-4.5 + 2, abs=0.05)


def test_rare_postures_objects_and_girths_cost_more():
    plain, rare = terms(), terms(replace(ADULT, posture="sitting", objects=True, girth=1.15))
    assert rare["posture"] - plain["posture"] == pytest.approx(np.log(19))
    assert rare["objects"] - plain["objects"] == pytest.approx(np.log(19))
    assert plain["girth"] == 0 and rare["girth"] > 1
    assert terms(replace(ADULT, girth=0.96 / 1.75 * 1.70))["girth"] == pytest.approx(0)


def test_a_template_costs_what_it_is_rare_by_at_a_stature():
    tall = Candidate(1.85, None, "male")
    assert terms(replace(tall, template="female"))["template"] > terms(tall)["template"] + 2
