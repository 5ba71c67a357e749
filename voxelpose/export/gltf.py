"""Binary glTF (GLB): skinned, animated body for Blender, three.js, Unity, Unreal and Godot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray

from silhouette_core.body.shape import vertex_normals
from silhouette_core.motion.conditioning import conditioning_words
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.smoothing import continuous_quaternions
from voxelpose.export.rigged import RiggedMotion, rigged
from voxelpose.people_marks import person_colour, person_names
from voxelpose.version import __version__

_TYPES = {(): gltf.SCALAR, (3,): gltf.VEC3, (4,): gltf.VEC4, (4, 4): gltf.MAT4}
_COMPONENTS = {
    "float32": gltf.FLOAT,
    "uint8": gltf.UNSIGNED_BYTE,
    "uint16": gltf.UNSIGNED_SHORT,
    "uint32": gltf.UNSIGNED_INT,
}
_LARGEST_SHORT = 65535  # as an index it restarts a strip


def write_glb(motion: Motion | RiggedMotion | Sequence[Motion | RiggedMotion], path: Path) -> None:
    """Writes a motion of at least one pose, or those of several people, as skinned, animated bodies
    in one file.

    Axis map: x = x, y = z, z = -y of the upright frame; metres. The skeleton's nodes, of ours 27 of
    a person, have the names of the body's parts; without animation they are in the rest pose (ours:
    upright, arms 45 degrees down, facing +z), to which the skin is bound. The only animation,
    `motion`, rotates every node and translates the root, and nodes that move in the one above. Its
    time is zero at the first pose. The document's extras state filter and filling of gaps. Of one
    person with the bones of VRM, the extension VRMC_vrm names them.

    Of several people each has a skeleton and a body of another colour, as in the overlays, under a
    node `person_1` and so on, whose extras state its filter and gaps; the animation moves all.

    Frames without a pose have no key: players interpolate over them along the shortest rotation, as
    they do between frames.
    """
    several = [motion] if isinstance(motion, Motion | RiggedMotion) else motion
    bodies = [rigged(one) for one in several]
    motions = [body.motion for body in bodies]
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator=f"voxelpose {__version__}"))
    first_frame = min(int(motion.frames[0]) for motion in motions)
    document.extras = {"fps": motions[0].fps, "first_frame": first_frame}
    packer, animation = _Packer(document), gltf.Animation(name="motion")
    alone, top = len(motions) == 1, list[int]()
    for k, (name, body) in enumerate(zip(person_names(len(bodies)), bodies, strict=True)):
        first, source = len(document.nodes), body.motion
        extras = {
            "conditioning": conditioning_words(source),
            "filled_frames": source.frames[source.filled].tolist(),
        }
        _add_skeleton(document, packer, body)
        _add_skin(document, packer, body, None if alone else person_colour(k))
        _add_animation(animation, packer, body, first + 1, first_frame)
        if alone:
            document.extras |= extras
            top = [first, first + 1]
            _add_humanoid(document, body, first + 1)
        else:
            top.append(len(document.nodes))
            document.nodes.append(gltf.Node(name=name, children=[first, first + 1], extras=extras))
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


def _add_skeleton(document: gltf.GLTF2, packer: _Packer, body: RiggedMotion) -> None:
    """Adds a node of the mesh, and nodes of the bones after it."""
    number, root, count = len(document.skins), len(document.nodes) + 1, len(body.names)
    rotations, places = (values[0] for values in body.at_rest().local())
    turned = quaternions(rotations)[:, [1, 2, 3, 0]]  # w comes last in glTF
    document.nodes.append(gltf.Node(name="body", mesh=number, skin=number))
    for bone, name in enumerate(body.names):
        children = (np.flatnonzero(body.parents == bone) + root).tolist()
        rest = gltf.Node(name=name, translation=places[bone].tolist(), children=children or None)
        if not np.allclose(rotations[bone], np.eye(3)):
            rest.rotation = turned[bone].tolist()
        document.nodes.append(rest)
    bind = np.zeros((count, 4, 4), np.float32)  # glTF stores columns first
    bind[:, :3, :3] = body.axes
    bind[:, 3, :3] = -np.einsum("bji,bj->bi", body.axes, body.rest_m)
    bind[:, 3, 3] = 1.0
    document.skins.append(
        gltf.Skin(
            name="skeleton",
            joints=list(range(root, root + count)),
            skeleton=root,
            inverseBindMatrices=packer.add(bind),
        )
    )


def _add_humanoid(document: gltf.GLTF2, body: RiggedMotion, root: int) -> None:
    """Adds what VRM 1.0 requires, where the bones are its own; the rest is as its defaults are: its
    author alone may be this figure.
    """
    if body.humanoid:
        bones = {name: {"node": root + bone} for bone, name in enumerate(body.names)}
        meta = {"name": "voxelpose", "authors": ["voxelpose"]}
        meta["licenseUrl"] = "https://vrm.dev/licenses/1.0/"
        vrm = {"specVersion": "1.0", "meta": meta, "humanoid": {"humanBones": bones}}
        document.extensionsUsed, document.extensions = ["VRMC_vrm"], {"VRMC_vrm": vrm}


def _add_skin(
    document: gltf.GLTF2, packer: _Packer, body: RiggedMotion, colour: Sequence[int] | None
) -> None:
    """Adds a mesh and its material of a colour, RGB; None: of clay."""
    vertices, faces = body.vertices_m, body.motion.model.faces
    weights = body.skin_weights.astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    bones = np.where(weights > 0, body.skin_bones, 0).astype(np.uint8)
    shape = {
        "POSITION": packer.add(vertices.astype(np.float32), gltf.ARRAY_BUFFER, bounds=True),
        "NORMAL": packer.add(vertex_normals(vertices, faces).astype(np.float32), gltf.ARRAY_BUFFER),
        "JOINTS_0": packer.add(bones, gltf.ARRAY_BUFFER),
        "WEIGHTS_0": packer.add(weights, gltf.ARRAY_BUFFER),
    }
    index = np.uint16 if len(vertices) < _LARGEST_SHORT else np.uint32
    corners = packer.add(faces.astype(index).ravel(), gltf.ELEMENT_ARRAY_BUFFER)
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
    animation: gltf.Animation, packer: _Packer, body: RiggedMotion, root: int, first_frame: int
) -> None:
    """Adds the channels of a skeleton whose nodes begin with that of the root."""
    turns, places = body.local()
    rotations, moving = continuous_quaternions(quaternions(turns)), body.moving(places)
    time_s = (body.motion.frames - first_frame) / body.motion.fps
    time = packer.add(time_s.astype(np.float32), bounds=True)
    for bone in range(len(body.names)):
        values = packer.add(rotations[:, bone, [1, 2, 3, 0]].astype(np.float32))
        _add_channel(animation, time, values, root + bone, "rotation")
    for bone in np.flatnonzero(moving).tolist():
        values = packer.add(places[:, bone].astype(np.float32))
        _add_channel(animation, time, values, root + bone, "translation")


def _add_channel(animation: gltf.Animation, time: int, values: int, node: int, path: str) -> None:
    target = gltf.AnimationChannelTarget(node=node, path=path)
    animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers), target=target))
    animation.samplers.append(
        gltf.AnimationSampler(input=time, output=values, interpolation=gltf.ANIM_LINEAR)
    )
