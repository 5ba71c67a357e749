"""Readers of rigs: MakeHuman, glTF, URDF and BVH, each into a `BodyModel`."""
