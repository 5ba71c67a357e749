"""Pixel weights of paper A's silhouette distance, nwXOR."""

import numpy as np

from calib.checks import BoolArray, Float32Array
from silhouette_core.image.distance import distances_to, relative_depths
from silhouette_core.image.spans import Rectangle
from silhouette_core.monocular.window import SIZE


def nwxor_weights(mask: BoolArray, bounds_px: Rectangle) -> Float32Array:
    r"""Weights of the pixels of a silhouette's window.

    Every pixel counts by its distance from the contour of the silhouette P, :math:`D_P` inside and
    :math:`D_{\neg P}` outside of it, normalised by the distance :math:`D_{P_{med}}` to the thinned
    silhouette, so that thick and thin parts count alike:

    .. math::
        :label: okada-9

        d_P = \frac{D_P}{D_P + D_{P_{med}}} + w' \, D_{\neg P}

    with w' one over the largest :math:`D_{\neg P}` in the rectangle that holds every pose of the
    tree, the outer limit of the outside: inside and outside have the same maximum in it.

    Args:
        mask: (h, w) bool, the silhouette P.
        bounds_px: that rectangle, `PoseLibrary.bounds_px`, in pixels of an image 240 high, whatever
            h is; where the silhouette covers it, the window.

    Returns:
        (h, w) float32, d_P: beyond the rectangle, where no pose is, above 1; all 1 where a
        silhouette that is empty or fills its window has no contour.

    Source: Okada and Stenger, eq. (9).
    """
    if not mask.any() or mask.all():
        return np.ones(mask.shape, np.float32)
    outside, scale = distances_to(mask), len(mask) / SIZE[1]
    left, top = np.floor(np.array(bounds_px[:2]) * scale).astype(int)
    right, bottom = np.ceil(np.array(bounds_px[2:]) * scale).astype(int)
    largest = outside[top:bottom, left:right].max(initial=np.float32(0.0)) or outside.max()
    return outside / largest + relative_depths(mask)  # eq. (9)
