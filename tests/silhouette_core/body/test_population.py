"""What is usual of people of a stature."""

import pytest

from silhouette_core.body.population import sex_probability


@pytest.mark.parametrize(
    ("stature_m", "female"), [(1.50, 0.95), (1.62, 0.88), (1.69, 0.52), (1.76, 0.12), (1.90, 0.05)]
)
def test_of_short_people_more_are_women(stature_m, female):
    found = [sex_probability(sex, stature_m) for sex in ("female", "male")]
    assert found == pytest.approx([female, 1 - female], abs=0.02)


def test_children_are_not_all_girls():
    assert sex_probability("male", 1.0) == pytest.approx(sex_probability("male", 1.4))
    assert sex_probability("male", 1.0) > 0.04
