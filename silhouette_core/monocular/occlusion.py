r"""Occlusion flags of parts."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.checks import BoolArray, FloatArray, IndexArray
from silhouette_core.body.model import BodyModel
from silhouette_core.image.raster import render_many
from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.monocular.window import SIZE, STATURE_PX

_SIDES, _FAR = 24, 2  # views of an upright body; their distance, in lengths of it


def usual_areas(areas: IndexArray) -> FloatArray:
    """Largest area that each part usually shows.

    Args:
        areas: (N, 27), pixels of each part in N poses.

    Returns:
        (27,) float64, pixels, the 99th percentile over the poses.
    """
    return np.percentile(areas, 99, axis=0)


def standing_areas(model: BodyModel) -> FloatArray:
    """Largest area that each part shows of an upright body, from all sides.

    Returns:
        (parts,) float64, pixels of the window, a stature away from the camera by `_FAR`.
    """
    yaws = np.arange(_SIDES)[:, None] * 360 / _SIDES
    turns = Rotation.from_euler("z", yaws, degrees=True).as_matrix()
    middle = 0.5 * (model.vertices_m.min(axis=0) + model.vertices_m.max(axis=0))
    turned = (model.vertices_m - middle) @ turns.transpose(0, 2, 1)
    x, y, z = np.moveaxis(turned / model.length_m, -1, 0)
    meshes = np.stack([x, -z, y + _FAR], axis=-1)
    focal, (width, height) = STATURE_PX * _FAR, SIZE
    matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    drawn = render_many(meshes, model.faces, model.face_part, matrix, SIZE)
    counts = [np.bincount(one.ravel(), minlength=len(model.names) + 1)[1:] for one in drawn]
    return np.max(counts, axis=0).astype(float)


def occluded_parts(areas: NDArray[np.number], usual: FloatArray) -> BoolArray:
    r"""Occlusion flags of the parts of a pose.

    .. math::
        :label: okada-3

        F_{occ}(x) = \{f_j\}_{j=1}^{N_b}, \qquad
        f_j = \begin{cases} 1 & \text{if } A_j < T_A \\ 0 & \text{else} \end{cases}

    where :math:`A_j` is the number of pixels that show part :math:`j` of the :math:`N_b = 27`
    parts in the projection of pose :math:`x`. The paper has one threshold :math:`T_A` in pixels;
    here it is a fraction of each part's usual largest area, since a hand never shows as much as
    a thigh.

    Args:
        areas: (..., 27), pixels, :math:`A_j`.
        usual: (27,) float64, pixels, see `usual_areas`.

    Returns:
        (..., 27) bool, :math:`f_j`.

    Source: Okada and Stenger, eq. (3); the threshold relative to the part is ours.
    """
    return areas < MOTION_MODEL.hidden_share * usual  # eq. (3)
