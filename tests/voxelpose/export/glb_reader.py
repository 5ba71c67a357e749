"""A second reader of GLB, from the text of the glTF 2.0 specification and not from the library that
wrote the file.
"""

import json
import struct
from copy import copy
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    """One file: `document` is its JSON, `array(k)` the values of accessor k."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length, json_length, json_kind = struct.unpack_from("<4sIIII", data)
        assert (magic, version, length, json_kind) == (b"glTF", 2, len(data), 0x4E4F534A)
        self.document = json.loads(data[20 : 20 + json_length])
        binary_length, binary_kind = struct.unpack_from("<II", data, 20 + json_length)
        assert binary_kind == 0x004E4942
        assert json_length % 4 == binary_length % 4 == 0
        self.binary = data[28 + json_length : 28 + json_length + binary_length]
        assert self.document["buffers"][0]["byteLength"] <= binary_length

    def only(self, person: str) -> "Glb":
        """The file of several people as if it held one of them."""
        nodes = self.document["nodes"]
        (top,) = (k for k, node in enumerate(nodes) if node["name"] == person)
        below = [top]
        for number in below:
            below += nodes[number].get("children", ())
        (body,) = (nodes[number] for number in below if "mesh" in nodes[number])
        animation = self.document["animations"][0]
        own = [one for one in animation["channels"] if one["target"]["node"] in below]
        one = copy(self)
        one.document = self.document | {
            "scenes": [{"nodes": [top]}],
            "animations": [animation | {"channels": own}],
            "meshes": [self.document["meshes"][body["mesh"]]],
            "skins": [self.document["skins"][body["skin"]]],
        }
        return one

    def array(self, number: int) -> np.ndarray:
        accessor = self.document["accessors"][number]
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        kind, width = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        assert start % 4 == 0
        assert "byteStride" not in view
        assert accessor["count"] * width * kind.itemsize == view["byteLength"]
        values = np.frombuffer(self.binary, kind, accessor["count"] * width, start).reshape(
            accessor["count"], width
        )
        if "min" in accessor:
            np.testing.assert_array_equal(values.min(axis=0), np.asarray(accessor["min"], kind))
            np.testing.assert_array_equal(values.max(axis=0), np.asarray(accessor["max"], kind))
        return values

    def channels(self) -> dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]:
        """(node, path): times (K,) and values (K, 3 or 4)."""
        animation = self.document["animations"][0]
        result = {}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            assert sampler.get("interpolation", "LINEAR") == "LINEAR"
            node = self.document["nodes"][channel["target"]["node"]]["name"]
            result[node, channel["target"]["path"]] = (
                self.array(sampler["input"])[:, 0],
                self.array(sampler["output"]),
            )
        return result

    def world_matrices(self, key: int) -> dict[str, np.ndarray]:
        """(4, 4) of every node at the key-th time, down from the scene's roots."""
        nodes, channels, result = self.document["nodes"], self.channels(), {}

        def place(number: int, above: np.ndarray) -> None:
            node = nodes[number]
            still = np.zeros(3), np.array([0, 0, 0, 1.0])
            moved = channels.get(
                (node["name"], "translation"),
                (None, [node.get("translation", still[0])] * (key + 1)),
            )[1][key]
            turned = channels.get(
                (node["name"], "rotation"), (None, [node.get("rotation", still[1])] * (key + 1))
            )[1][key]
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(turned).as_matrix(), moved
            result[node["name"]] = above @ matrix
            for child in node.get("children", ()):
                place(child, result[node["name"]])

        for number in self.document["scenes"][self.document["scene"]]["nodes"]:
            place(number, np.eye(4))
        return result

    def skinned(self, key: int) -> np.ndarray:
        """(V, 3): the body's surface at the key-th time; the skin's joints alone place it, as the
        specification says.
        """
        primitive, skin = self.document["meshes"][0]["primitives"][0], self.document["skins"][0]
        world = self.world_matrices(key)
        bind = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        joints = (
            np.array([world[self.document["nodes"][joint]["name"]] for joint in skin["joints"]])
            @ bind
        )
        shape = {name: self.array(number) for name, number in primitive["attributes"].items()}
        blended = np.einsum("vk,vkij->vij", shape["WEIGHTS_0"], joints[shape["JOINTS_0"]])
        return np.einsum("vij,vj->vi", blended[:, :3, :3], shape["POSITION"]) + blended[:, :3, 3]
