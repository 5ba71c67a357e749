"""Binary glTF (GLB): skinned, animated body for Blender, three.js, Unity, Unreal and Godot."""

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
from voxelpose.version import __version__

_TYPES = {(): gltf.SCALAR, (3,): gltf.VEC3, (4,): gltf.VEC4, (4, 4): gltf.MAT4}
_COMPONENTS = {
    "float32": gltf.FLOAT,
    "uint8": gltf.UNSIGNED_BYTE,
    "uint16": gltf.UNSIGNED_SHORT,
    "uint32": gltf.UNSIGNED_INT,
}
_LARGEST_SHORT = 65535  # as an index it restarts a strip
_BODY = 0  # node of the mesh; the node of part p is p + 1


def write_glb(motion: Motion, path: Path) -> None:
    """Writes a motion of at least one pose as a skinned, animated body in one file.

    Axis map: x = x, y = z, z = -y of the upright frame; metres. The skeleton's nodes, of a person
    27, have the names of the body's parts; without animation they are in the rest pose (upright,
    arms 45 degrees down, facing +z), to which the skin is bound. The only animation, `motion`,
    rotates every node and translates the root (`pelvis`). Its time is zero at the first pose. The
    document's extras state filter and filling of gaps.

    Frames without a pose have no key: players interpolate over them along the shortest rotation, as
    they do between frames.
    """
    motion = motion.upright()
    model = motion.model
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator=f"voxelpose {__version__}"))
    document.extras = {
        "fps": motion.fps,
        "first_frame": int(motion.frames[0]),
        "conditioning": conditioning_words(motion),
        "filled_frames": motion.frames[motion.filled].tolist(),
    }
    packer = _Packer(document)
    _add_skeleton(document, packer, model)
    _add_body(document, packer, model)
    _add_animation(document, packer, motion)
    document.scenes = [gltf.Scene(nodes=[_BODY, 1])]
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
    joints = model.joints_m @ Y_UP_FROM_WORLD.T
    document.nodes = [gltf.Node(name="body", mesh=0, skin=0)]
    for part, (name, parent) in enumerate(zip(model.names, model.tree.parents, strict=True)):
        offset = joints[part] - (joints[parent] if parent >= 0 else 0)
        children = (np.flatnonzero(model.tree.parents == part) + 1).tolist()
        document.nodes.append(
            gltf.Node(name=name, translation=offset.tolist(), children=children or None)
        )
    bind = np.tile(np.eye(4, dtype=np.float32), (len(joints), 1, 1))
    bind[:, 3, :3] = -joints  # glTF stores columns first: the translation is the last row here
    document.skins = [
        gltf.Skin(
            name="skeleton",
            joints=list(range(1, len(joints) + 1)),
            skeleton=1,
            inverseBindMatrices=packer.add(bind),
        )
    ]


def _add_body(document: gltf.GLTF2, packer: _Packer, model: BodyModel) -> None:
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
    primitive = gltf.Primitive(attributes=gltf.Attributes(**shape), indices=corners, material=0)
    document.meshes = [gltf.Mesh(name="body", primitives=[primitive])]
    surface = gltf.PbrMetallicRoughness(
        baseColorFactor=[0.75, 0.72, 0.68, 1.0], metallicFactor=0.0, roughnessFactor=0.8
    )
    document.materials = [
        gltf.Material(name="body", pbrMetallicRoughness=surface, alphaCutoff=None)
    ]


def _add_animation(document: gltf.GLTF2, packer: _Packer, motion: Motion) -> None:
    rotations = continuous_quaternions(
        quaternions(Y_UP_FROM_WORLD @ local_rotations(motion) @ Y_UP_FROM_WORLD.T)
    )
    root = motion.parts()[1][:, 0] @ Y_UP_FROM_WORLD.T
    time = packer.add(
        ((motion.frames - motion.frames[0]) / motion.fps).astype(np.float32), bounds=True
    )
    animation = gltf.Animation(name="motion")
    for part in range(len(motion.model.names)):
        values = packer.add(
            rotations[:, part, [1, 2, 3, 0]].astype(np.float32)
        )  # w comes last in glTF
        _add_channel(animation, time, values, part + 1, "rotation")
    _add_channel(animation, time, packer.add(root.astype(np.float32)), 1, "translation")
    document.animations = [animation]


def _add_channel(animation: gltf.Animation, time: int, values: int, node: int, path: str) -> None:
    target = gltf.AnimationChannelTarget(node=node, path=path)
    animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers), target=target))
    animation.samplers.append(
        gltf.AnimationSampler(input=time, output=values, interpolation=gltf.ANIM_LINEAR)
    )
