"""Pictures of bodies: what they show, and that bent joints stay whole."""

import numpy as np
import pytest

from silhouette_core.body.mesh_measurements import enclosed_volume
from silhouette_core.body.presets import body_preset
from voxelpose.view.images.hull_picture import bent_vertices, bodies_picture


@pytest.mark.parametrize("name", ["92A5", "104E6", "5AP", "13BR"])
def test_bending_neither_tears_nor_empties_a_body(name):
    body = body_preset(name).body()
    bent = bent_vertices(body)
    volumes = [enclosed_volume(v, body.faces) for v in (bent, body.vertices_m)]
    assert 0.9 < volumes[0] / volumes[1] < 1.02  # linear blend skinning loses some in the folds
    edges = body.faces[:, [0, 1]]
    lengths = [
        np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (bent, body.vertices_m)
    ]
    stretch = lengths[0] / lengths[1]
    assert np.percentile(stretch, 99) < 2 and stretch.max() < 6
    assert np.abs(bent - body.vertices_m).max() > 0.3


def test_bodies_stand_on_one_floor_at_one_scale():
    bodies = [body_preset(name).body() for name in ("100A7", "9APP")]
    picture = bodies_picture(bodies, ["tall\n", "small\n"])
    halves = np.array_split(picture[:262], 2, axis=1)
    rows = [np.flatnonzero((half != picture[0, 0]).any((1, 2))) for half in halves]
    assert abs(rows[0][-1] - rows[1][-1]) <= 2
    assert np.ptp(rows[1]) / np.ptp(rows[0]) == pytest.approx(1.42 / 1.80, rel=0.02)
