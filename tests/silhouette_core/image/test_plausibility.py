"""Silhouettes that cannot be those of a person are told before any pose is looked for."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.image.plausibility import check_plausible

RNG = np.random.default_rng(3)
PERSON = np.zeros((120, 160), bool)
PERSON[20:100, 60:80] = PERSON[30:40, 40:100] = True
WHITE = np.ones((120, 160), bool)
NOISE = RNG.random((120, 160)) < 0.5
NOBODY = np.zeros((120, 160), bool)


def test_a_person_and_an_empty_view_are_plausible():
    check_plausible({"a": [PERSON, PERSON, NOBODY], "b": [NOBODY] * 3}, least=2)
    with pytest.raises(InputError, match="those of b"):
        check_plausible({"a": [PERSON, PERSON, NOBODY], "b": [WHITE] * 3}, least=2)


@pytest.mark.parametrize(
    ("mask", "words"),
    [(WHITE, "those of b cover 100 % of the picture"), (NOISE, "those of b are specks")],
)
def test_what_cannot_be_a_person_is_named(mask, words):
    masks = {"a": [PERSON] * 3, "b": [mask] * 3}
    check_plausible(masks, least=1)  # the other one will do
    with pytest.raises(InputError, match=words):
        check_plausible(masks, least=2)


def test_a_few_bad_moments_are_no_reason():
    check_plausible({"a": [WHITE, PERSON, PERSON]}, least=1)
    with pytest.raises(InputError, match="those of a"):
        check_plausible({"a": [WHITE, WHITE, PERSON]}, least=1)
