"""The person's body in the page: a skinned mesh whose bones follow the pose."""

import time

import numpy as np
import viser
from numpy.typing import NDArray

from silhouette_core.body.joints import HUMAN
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kinematics import quaternions
from voxelpose.live.live_frame import PosedBody
from voxelpose.view.serving.viser_internals import move_bones

_REBUILD_S = 1  # an estimation that adapts the body may give a new one with every frame


def _bone_parts() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Parts (18,) that are bones of the mesh, and for each part (27,) the bone that moves it.

    Parts whose joints the estimation leaves at rest move with their parents: every bone costs.
    """
    movable = np.zeros(len(HUMAN.names), bool)
    movable[HUMAN.dof_part[~HUMAN.dof_fixed]] = True
    bones: list[int] = []
    bone_of = np.zeros(len(movable), np.int64)
    for part, parent in enumerate(HUMAN.parents):
        if parent < 0 or movable[part]:
            bone_of[part] = len(bones)
            bones.append(part)
        else:
            bone_of[part] = bone_of[parent]
    return np.array(bones), bone_of


_BONES, _BONE_OF = _bone_parts()


class SkinnedFigure:
    """Draws the body: browsers get its mesh once, then only the bones' places and rotations."""

    def __init__(self, scene: viser.SceneApi) -> None:
        """Prepares; nothing is drawn before the first body."""
        self._scene = scene
        self._handle: viser.MeshSkinnedHandle | None = None
        self._model: BodyModel | None = None
        self._built_s = -np.inf
        self._places = np.zeros((len(_BONES), 7))

    def draw(self, body: PosedBody | None) -> None:
        """Shows a body; None: hides it."""
        if body is not None and self._is_other(body.model):
            self._build(body.model)
        if self._handle is None:
            return
        self._handle.visible = body is not None
        if body is None:
            return
        places = np.hstack([quaternions(body.part_rotation[_BONES]), body.part_origin_m[_BONES]])
        still = 2e-4  # metres and components of quaternions: what nobody sees is not sent
        moved = np.flatnonzero(np.abs(places - self._places).max(1) > still)
        move_bones(self._handle, moved, places[moved])
        self._places[moved] = places[moved]

    def _is_other(self, model: BodyModel) -> bool:
        shown = self._model
        if shown is None:
            return True
        if model is shown or time.monotonic() - self._built_s < _REBUILD_S:
            return False
        same = model.sizes == shown.sizes and np.array_equal(model.shape, shown.shape)
        if same:
            self._model = model
        return not same

    def _build(self, model: BodyModel) -> None:
        if self._handle is not None:
            self._handle.remove()
        weights = np.zeros((len(model.vertices_m), len(_BONES)), np.float32)
        rows = np.arange(len(weights))[:, None]
        np.add.at(weights, (rows, _BONE_OF[model.skin_parts]), model.skin_weights)
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(_BONES), 1))
        self._places = np.hstack([turns, model.joints_m[_BONES]])
        self._handle = self._scene.add_mesh_skinned(
            "/figure",
            model.vertices_m.astype(np.float32),
            model.faces.astype(np.uint32),
            bone_wxyzs=turns,
            bone_positions=model.joints_m[_BONES],
            skin_weights=weights,
            color=(84, 146, 214),
        )
        self._model, self._built_s = model, time.monotonic()
