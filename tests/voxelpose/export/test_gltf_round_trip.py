"""A body that is written as glTF is read back as the same body."""

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigs.gltf_rig import read_gltf
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.motion import Motion
from voxelpose.export.gltf import write_glb


def test_the_exported_body_comes_back(tmp_path):
    body = BodyModel.from_sizes(BodySizes(1.75, sex="female"))
    angles = np.linspace(-0.1, 0.1, body.dof_count)[None]
    place = np.array([[0.3, -0.2, 0.9]]), np.array([[1.0, 0, 0, 0]])
    motion = Motion(30.0, body, *place, angles, np.zeros(1, np.int64), np.zeros(1))
    write_glb(motion, tmp_path / "body.glb")
    back = read_gltf(tmp_path / "body.glb")
    order = [back.names.index(name) for name in body.names]
    assert sorted(back.names) == sorted(body.names)
    assert np.allclose(back.joints_m[order], body.joints_m, atol=1e-6)
    assert np.allclose(back.vertices_m, body.vertices_m, atol=1e-6)
    assert np.array_equal(back.faces, body.faces)
    for part, parent in enumerate(body.tree.parents):
        own = back.tree.parents[order[part]]
        assert own == (order[parent] if parent >= 0 else -1)
    dense = np.zeros((2, len(body.vertices_m), len(body.names)))
    for k, (model, rename) in enumerate(((body, np.arange(len(order))), (back, np.argsort(order)))):
        rows = np.arange(len(model.vertices_m))[:, None]
        np.add.at(dense[k], (rows, rename[model.skin_parts]), model.skin_weights)
    assert np.allclose(*dense, atol=1e-6)
