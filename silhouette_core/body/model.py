"""Articulated body model: parts, joints, limits, a closed mesh and a shape space."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from safetensors import safe_open

from calib.errors import InputError
from silhouette_core.body.joint_centres import read_joint_centres
from silhouette_core.body.joints import HUMAN
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.shape import ShapeSpace, vertex_normals
from silhouette_core.body.sizes import SHAPE_AXES, BodySizes
from silhouette_core.body.template_warp import Changes, warp_template
from silhouette_core.body.volume import sample_volume
from silhouette_core.tuning import MEASURING


@dataclass(frozen=True, eq=False)
class BodyModel:
    """Articulated body at rest.

    Lengths are in metres, in the body frame: z up, facing -y, left hand toward +x.
    """

    joints_m: np.ndarray  #: (P, 3) float64, joints at the proximal ends of the parts.
    vertices_m: np.ndarray  #: (V, 3) float64, vertices of the closed surface.
    faces: np.ndarray  #: (F, 3) int32, outward oriented triangles.
    face_part: np.ndarray  #: (F,) int32, part of each triangle.
    skin_parts: np.ndarray  #: (V, 4) int32, parts that move a vertex.
    skin_weights: np.ndarray  #: (V, 4) float64, weights of those parts, summing to 1.
    landmarks_m: np.ndarray
    """(L, 3) float64, the landmarks at rest, in the order of the tree; of a person the HumanEva
    joints, `joints.LANDMARK_NAMES`."""
    space: ShapeSpace  #: shape space around the template.
    shape: np.ndarray  #: (K,) float64, deviations along `SHAPE_AXES`; (0,) of a given shape.
    person: BodySizes | None  #: Measurements of the person; None: no person's, or as given.
    tree: KinematicTree = HUMAN

    @property
    def sizes(self) -> BodySizes:
        """Measurements of the person. Raises InputError where the body is not made from a person's
        measurements.
        """
        if self.person is None:
            raise InputError(
                "this needs a body made from a person's measurements, and the one here was given"
                f" as it is ({len(self.names)} parts, root {self.names[0]!r}): fit without a body"
            )
        return self.person

    @cached_property
    def extent_m(self) -> float:
        """Largest side of the box around the body at rest."""
        return float(np.ptp(self.vertices_m, axis=0).max())

    @property
    def length_m(self) -> float:
        """Length by which silhouettes are scaled: a person's stature, else `extent_m`."""
        return self.extent_m if self.person is None else self.person.stature_m

    @classmethod
    def from_sizes(cls, sizes: BodySizes) -> "BodyModel":
        """Default body of a person's stature, and chest girth and sex if known; an unknown sex
        takes the man's template.

        Returns:
            The template of that sex, scaled to the stature, with girths that follow the chest's, or
            those of the changes.
        """
        template = read_template(sizes.sex)
        if any(sizes.changes):
            template = template.warped(sizes.changes)
        scale = sizes.stature_m / template.sizes.stature_m
        body = template._scaled(scale, sizes)
        if sizes.chest_girth_m is None or any(sizes.changes):
            return body
        stout = sizes.chest_girth_m / ((template.sizes.chest_girth_m or np.nan) * scale) - 1
        shape = np.zeros(len(SHAPE_AXES))
        for k, axis in enumerate(SHAPE_AXES):
            if axis.name in ("trunk_width", "trunk_depth"):
                shape[k] = stout
            elif axis.name.endswith("_girth"):
                shape[k] = MEASURING.chest_slope * stout
        return body.reshaped(shape)

    @classmethod
    def as_given(
        cls,
        tree: KinematicTree,
        joints_m: np.ndarray,
        vertices_m: np.ndarray,
        faces: np.ndarray,
        face_part: np.ndarray,
        skin: tuple[np.ndarray, np.ndarray],
        landmarks_m: np.ndarray,
    ) -> "BodyModel":
        """Body that is not made from a person's measurements, and keeps its shape.

        Args:
            joints_m: (P, 3) float64.
            vertices_m: (V, 3) float64.
            faces: (F, 3) integers.
            face_part: (F,) integers.
            skin: (V, 4) parts that move each vertex, and their weights.
            landmarks_m: (L, 3) float64.
        """
        return cls(
            joints_m=joints_m,
            vertices_m=vertices_m,
            faces=faces.astype(np.int32),
            face_part=face_part.astype(np.int32),
            skin_parts=skin[0],
            skin_weights=skin[1],
            landmarks_m=landmarks_m,
            space=ShapeSpace.rigid(joints_m, vertices_m, landmarks_m),
            shape=np.zeros(0),
            person=None,
            tree=tree,
        )

    def reshaped(self, shape: np.ndarray) -> "BodyModel":
        """This body with other deviations (K,) float64 along the shape axes, relative to the
        template scaled to the stature.
        """
        joints, vertices, landmarks = self.space.apply(np.asarray(shape, float))
        return replace(
            self,
            joints_m=joints,
            vertices_m=vertices,
            landmarks_m=landmarks,
            shape=np.asarray(shape, float),
        )

    def warped(self, changes: Changes) -> "BodyModel":
        """This template with other chest, waist, hips and thighs."""
        joints, parts, weights = self.joints_m, self.skin_parts, self.skin_weights
        vertices = warp_template(self.vertices_m, joints, parts, weights, changes)
        space = ShapeSpace.from_rest(joints, vertices, self.landmarks_m, parts, weights, self.faces)
        return replace(self, vertices_m=vertices, space=space)

    def scaled(self, stature_m: float) -> "BodyModel":
        """This person's body with the same proportions and another stature."""
        factor, chest_m = stature_m / self.sizes.stature_m, self.sizes.chest_girth_m
        chest_m = None if chest_m is None else chest_m * factor
        sizes = replace(self.sizes, stature_m=stature_m, chest_girth_m=chest_m)
        return self._scaled(factor, sizes)

    def _scaled(self, factor: float, sizes: BodySizes) -> "BodyModel":
        return replace(
            self,
            joints_m=self.joints_m * factor,
            vertices_m=self.vertices_m * factor,
            landmarks_m=self.landmarks_m * factor,
            space=self.space.scaled(factor),
            person=sizes,
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the P parts."""
        return self.tree.names

    @property
    def dof_count(self) -> int:
        """Number of joint angles."""
        return len(self.tree.dofs)

    @cached_property
    def joint_centres_m(self) -> np.ndarray:
        """Joints of joints.csv (L, 3) float64 at rest: the landmarks, of a person moved to where
        those of people of this shape lie.
        """
        if self.person is None:
            return self.landmarks_m
        centres = read_joint_centres(template_name(self.sizes.sex))
        return self.landmarks_m + self.sizes.stature_m * centres.offsets(self.shape)

    @cached_property
    def vertex_normals(self) -> np.ndarray:
        """Outward unit normals (V, 3) float64 of the vertices, weighted by area."""
        return vertex_normals(self.vertices_m, self.faces)

    def part_points(self, spacing_m: float) -> list[np.ndarray]:
        """Lattice points inside every part: 27 arrays (n_p, 3) float64, positions at rest relative
        to the part's own joint.

        Args:
            spacing_m: distance between neighbouring samples.
        """
        points, part = sample_volume(self.vertices_m, self.faces, self.face_part, spacing_m)
        return [points[part == p] - self.joints_m[p] for p in range(len(self.names))]

    def part_volumes_m3(self, spacing_m: float = 0.01) -> np.ndarray:
        """Volumes (27,) of the parts, m³, counted on a lattice."""
        _, part = sample_volume(self.vertices_m, self.faces, self.face_part, spacing_m)
        return np.bincount(part, minlength=len(self.names)) * spacing_m**3


def template_name(sex: str) -> str:
    """Name of the template of a sex, the man's for an unknown one."""
    return "woman" if sex == "female" else "man"


def read_template(sex: str) -> BodyModel:
    """Template body of a sex, the man's for an unknown one. Raises InputError where its file is
    missing from the installation.
    """
    path = Path(__file__).with_name(f"{template_name(sex)}.safetensors")
    try:
        with safe_open(str(path), framework="numpy") as file:
            data = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
            about = file.metadata()
    except FileNotFoundError:
        raise InputError(
            f"the body template {path.name} is missing from the installation: install voxelpose"
            " again"
        ) from None
    joints, vertices, landmarks = (
        data[key].astype(float) for key in ("joints_m", "vertices_m", "landmarks_m")
    )
    weights = data["skin_weights"].astype(float)
    weights /= weights.sum(1, keepdims=True)
    sizes = BodySizes(float(about["stature"]), float(about["chest_girth"]), about["sex"])
    parts, faces = data["skin_parts"], data["faces"]
    space = ShapeSpace.from_rest(joints, vertices, landmarks, parts, weights, faces)
    return BodyModel(
        joints_m=joints,
        vertices_m=vertices,
        faces=faces.astype(np.int32),
        face_part=data["face_part"].astype(np.int32),
        skin_parts=parts.astype(np.int32),
        skin_weights=weights,
        landmarks_m=landmarks,
        space=space,
        shape=np.zeros(len(SHAPE_AXES)),
        person=sizes,
    )
