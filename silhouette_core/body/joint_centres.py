r"""Where a person's joint centres lie in a template that was adapted to silhouettes.

The surface of a template follows silhouettes, and its joints follow the surface in the template's
proportions. Where those of other people lie is learned from bodies whose joints are known
(`tools.templates.joint_centres`): the mean of a Gaussian process over the shape. Of a shape unlike
all of them it is the template's joint.

.. math:: c(z) = \sum_n e^{-\lVert z - z_n \rVert^2 / 2 \lambda^2} \alpha_n

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), equation 2.27.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from safetensors import safe_open

from calib.checks import FloatArray
from silhouette_core.body.sizes import SHAPE_SIGMA

FILE = Path(__file__).with_suffix(".safetensors")


@dataclass(frozen=True, eq=False)
class JointCentres:
    """Mean of a Gaussian process. N bodies, K shape axes, L landmarks."""

    shapes: FloatArray  #: (N, K) shapes z_n of the bodies, in standard deviations of people.
    weights: FloatArray  #: (N, L, 3) alpha_n, in statures, in the frame of a landmark's part.
    width: float  #: lambda, in standard deviations of people.

    def offsets(self, shape: FloatArray) -> FloatArray:
        """Offsets (L, 3) of the joint centres from a template's landmarks at rest, in statures.

        Args:
            shape: (K,), deviations along the shape axes.
        """
        return np.tensordot(self.kernel(shape / SHAPE_SIGMA), self.weights, 1)

    def kernel(self, scaled: FloatArray) -> FloatArray:
        """Covariances (…, N) of shapes (…, K), in standard deviations, with those of the bodies."""
        square = ((scaled[..., None, :] - self.shapes) ** 2).sum(-1)
        return np.exp(-0.5 * square / self.width**2)


@cache
def read_joint_centres(template: str) -> JointCentres:
    """The joint centres of a template, "man" or "woman"."""
    with safe_open(str(FILE), framework="numpy") as file:
        shapes, weights = (
            file.get_tensor(f"{template}_{name}").astype(float) for name in ("shapes", "weights")
        )
        return JointCentres(shapes, weights, float(file.metadata()[f"{template}_width"]))
