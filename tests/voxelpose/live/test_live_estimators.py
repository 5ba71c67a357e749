"""What the process of poses sends."""

from dataclasses import replace

from tests.voxelpose.live.live_scenes import person, posed
from voxelpose.live.live_estimators import _ChangedModels


class Finder:
    """Finds somebody as the second of two."""

    def step(self, body):
        return None, body


def test_the_body_of_each_person_is_sent_when_it_has_changed():
    sparing, body, other = _ChangedModels(Finder, ()), posed(), posed(model=replace(person(1.8)))
    sent = [sparing.step(one) for one in (body, body, other, other, body)]
    assert all(first is None for first, _ in sent)
    models = [second.model for _, second in sent if second is not None]
    assert models == [body.model, None, other.model, None, body.model]
