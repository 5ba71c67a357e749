"""Binary glTF (GLB): skinned, animated body for Blender, three.js, Unity, Unreal and Godot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.conditioning import conditioning_words
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.smoothing import continuous_quaternions
from voxelpose.export.skeleton import Y_UP_FROM_WORLD, local_rotations
from voxelpose.people_marks import COLOURS, person_names
from voxelpose.version import __version__

_TYPES = {(): gltf.SCALAR, (3,): gltf.VEC3, (4,): gltf.VEC4, (4, 4): gltf.MAT4}
_COMPONENTS = {
    "float32": gltf.FLOAT,
    "uint8": gltf.UNSIGNED_BYTE,
    "uint16": gltf.UNSIGNED_SHORT,
    "uint32": gltf.UNSIGNED_INT,
}
_LARGEST_SHORT = 65535  # as an index it restarts a strip


def write_glb(motion: Motion | Sequence[Motion], path: Path) -> None:
    """Writes a motion of at least one pose, or those of several people, as skinned, animated bodies
    in one file.

    Axis map: x = x, y = z, z = -y of the upright frame; metres. The skeleton's nodes, of a person
    27, have the names of the body's parts; without animation they are in the rest pose (upright,
    arms 45 degrees down, facing +z), to which the skin is bound. The only animation, `motion`,
    rotates every node and translates the root (`pelvis`). Its time is zero at the first pose. The
    document's extras state filter and filling of gaps.

    Of several people each has a skeleton and a body of another colour, as in the overlays, under a
    node `person_1` and so on, whose extras state its filter and gaps; the animation moves all.

    Frames without a pose have no key: players interpolate over them along the shortest rotation, as
    they do between frames.
    """
    motions = [motion] if isinstance(motion, Motion) else motion
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator=f"voxelpose {__version__}"))
    first_frame = min(int(motion.frames[0]) for motion in motions)
    document.extras = {"fps": motions[0].fps, "first_frame": first_frame}
    packer, animation = _Packer(document), gltf.Animation(name="motion")
    alone, top = len(motions) == 1, list[int]()
    for k, (name, motion) in enumerate(zip(person_names(len(motions)), motions, strict=True)):
        upright, body = motion.upright(), len(document.nodes)
        extras = {
            "conditioning": conditioning_words(motion),
            "filled_frames": motion.frames[motion.filled].tolist(),
        }
        _add_skeleton(document, packer, upright.model)
        _add_body(document, packer, upright.model, None if alone else COLOURS[k % len(COLOURS)])
        _add_animation(animation, packer, upright, body + 1, first_frame)
        if alone:
            document.extras |= extras
            top = [body, body + 1]
        else:
            top.append(len(document.nodes))
            document.nodes.append(gltf.Node(name=name, children=[body, body + 1], extras=extras))
    document.animations = [animation]
    document.scenes = [gltf.Scene(nodes=top)]
    document.scene = 0
    document.buffers = [gltf.Buffer(byteLength=len(packer.data))]
    document.set_binary_blob(bytes(packer.data))
    path.write_bytes(b"".join(document.save_to_bytes()))


class _Packer:
    """Buffer of arrays, each aligned to four bytes as glTF requires."""

    def __init__(self, document: gltf.GLTF2) -> None:
        self.document = document
        self.data = bytearray()

    def add(self, array: NDArray, target: int | None = None, bounds: bool = False) -> int:
        """Appends an array; returns the index of its accessor."""
        self.data += bytes(-len(self.data) % 4)
        view = gltf.BufferView(
            buffer=0, byteOffset=len(self.data), byteLength=array.nbytes, target=target
        )
        accessor = gltf.Accessor(
            bufferView=len(self.document.bufferViews),
            byteOffset=0,
            componentType=_COMPONENTS[array.dtype.name],
            count=len(array),
            type=_TYPES[array.shape[1:]],
            min=np.atleast_1d(array.min(axis=0)).tolist() if bounds else None,
            max=np.atleast_1d(array.max(axis=0)).tolist() if bounds else None,
        )
        self.data += np.ascontiguousarray(array).tobytes()
        self.document.bufferViews.append(view)
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1


def _add_skeleton(document: gltf.GLTF2, packer: _Packer, model: BodyModel) -> None:
    """Adds a node of the mesh, and nodes of the parts after it."""
    joints = model.joints_m @ Y_UP_FROM_WORLD.T
    number, root = len(document.skins), len(document.nodes) + 1
    document.nodes.append(gltf.Node(name="body", mesh=number, skin=number))
    for part, (name, parent) in enumerate(zip(model.names, model.tree.parents, strict=True)):
        offset = joints[part] - (joints[parent] if parent >= 0 else 0)
        children = (np.flatnonzero(model.tree.parents == part) + root).tolist()
        document.nodes.append(
            gltf.Node(name=name, translation=offset.tolist(), children=children or None)
        )
    bind = np.tile(np.eye(4, dtype=np.float32), (len(joints), 1, 1))
    bind[:, 3, :3] = -joints  # glTF stores columns first: the translation is the last row here
    document.skins.append(
        gltf.Skin(
            name="skeleton",
            joints=list(range(root, root + len(joints))),
            skeleton=root,
            inverseBindMatrices=packer.add(bind),
        )
    )


def _add_body(
    document: gltf.GLTF2, packer: _Packer, model: BodyModel, colour: Sequence[int] | None
) -> None:
    """Adds a mesh and its material of a colour, RGB; None: of clay."""
    weights = model.skin_weights.astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    parts = np.where(weights > 0, model.skin_parts, 0).astype(np.uint8)
    shape = {
        "POSITION": packer.add(
            (model.vertices_m @ Y_UP_FROM_WORLD.T).astype(np.float32),
            gltf.ARRAY_BUFFER,
            bounds=True,
        ),
        "NORMAL": packer.add(
            (model.vertex_normals @ Y_UP_FROM_WORLD.T).astype(np.float32), gltf.ARRAY_BUFFER
        ),
        "JOINTS_0": packer.add(parts, gltf.ARRAY_BUFFER),
        "WEIGHTS_0": packer.add(weights, gltf.ARRAY_BUFFER),
    }
    index = np.uint16 if len(model.vertices_m) < _LARGEST_SHORT else np.uint32
    corners = packer.add(model.faces.astype(index).ravel(), gltf.ELEMENT_ARRAY_BUFFER)
    primitive = gltf.Primitive(
        attributes=gltf.Attributes(**shape), indices=corners, material=len(document.materials)
    )
    document.meshes.append(gltf.Mesh(name="body", primitives=[primitive]))
    linear = [0.75, 0.72, 0.68]
    if colour is not None:
        linear = [round((value / 255) ** 2.2, 4) for value in colour]
    surface = gltf.PbrMetallicRoughness(
        baseColorFactor=[*linear, 1.0], metallicFactor=0.0, roughnessFactor=0.8
    )
    document.materials.append(
        gltf.Material(name="body", pbrMetallicRoughness=surface, alphaCutoff=None)
    )


def _add_animation(
    animation: gltf.Animation, packer: _Packer, motion: Motion, root: int, first_frame: int
) -> None:
    """Adds the channels of a skeleton whose nodes begin with that of the root."""
    rotations = continuous_quaternions(
        quaternions(Y_UP_FROM_WORLD @ local_rotations(motion) @ Y_UP_FROM_WORLD.T)
    )
    places = motion.parts()[1][:, 0] @ Y_UP_FROM_WORLD.T
    time = packer.add(((motion.frames - first_frame) / motion.fps).astype(np.float32), bounds=True)
    for part in range(len(motion.model.names)):
        values = packer.add(
            rotations[:, part, [1, 2, 3, 0]].astype(np.float32)
        )  # w comes last in glTF
        _add_channel(animation, time, values, root + part, "rotation")
    _add_channel(animation, time, packer.add(places.astype(np.float32)), root, "translation")


def _add_channel(animation: gltf.Animation, time: int, values: int, node: int, path: str) -> None:
    target = gltf.AnimationChannelTarget(node=node, path=path)
    animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers), target=target))
    animation.samplers.append(
        gltf.AnimationSampler(input=time, output=values, interpolation=gltf.ANIM_LINEAR)
    )
