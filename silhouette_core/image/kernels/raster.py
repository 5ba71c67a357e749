"""Part-number raster: a mesh drawn into an image of labels and one of depths.

Screen positions are rounded to 1/256 pixel and kept as integers, so that the edge tests are exact:
two triangles that share an edge see the same number with opposite signs, and the top-left rule
gives every pixel centre on it to exactly one of them.

Source: Okada and Stenger, section 3.1; edge functions as in Pineda, "A parallel algorithm for
polygon rasterization" (1988), the clipping is that of Sutherland and Hodgman. Reference:
`tests.oracles.image.draw`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange

SUBPIXELS = 256
_NARROW = 12  # pixels
LIMIT = SUBPIXELS << 21  # keeps products of two coordinate differences inside int64


@kernel
def _to_screen(pixel):
    """Pixel coordinate in subpixels, rounded and clamped to the limit."""
    scaled = np.floor(pixel * SUBPIXELS + 0.5)
    return np.int64(min(max(scaled, -LIMIT), LIMIT))


@kernel
def _edge(dx, dy, start_x, start_y, row):
    """Edge from `start` along (dx, dy) in a row: a pixel is on its inner side where the first
    number plus the second times its column is not negative.
    """
    # Left edges and flat top edges own the pixel centres on them.
    inclusive = dy < 0 or (dy == 0 and dx > 0)
    constant = dx * (row * SUBPIXELS - start_y) + dy * start_x - (0 if inclusive else 1)
    return constant, -dy * SUBPIXELS


@kernel
def _row_span(constant, slope, first, last):
    """Pixels of [first, last] on the inner side of an edge in a row."""
    if slope > 0:
        first = max(first, -(constant // slope))
    elif slope < 0:
        last = min(last, constant // -slope)
    elif constant < 0:
        last = first - 1
    return first, last


@kernel
def _fill(ax, ay, aw, bx, by, bw, cx, cy, cw, label, cull, parts, depth):
    """Draws a triangle of corners (x, y, w): subpixels, and inverse depth, linear on the screen."""
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area == 0 or (cull and area > 0):
        return
    if area < 0:
        bx, by, bw, cx, cy, cw = cx, cy, cw, bx, by, bw
        area = -area
    height, width = parts.shape
    top = max(-(-min(ay, by, cy) // SUBPIXELS), 0)
    bottom = min(max(ay, by, cy) // SUBPIXELS, height - 1)
    left = max(-(-min(ax, bx, cx) // SUBPIXELS), 0)
    right = min(max(ax, bx, cx) // SUBPIXELS, width - 1)
    if left > right:
        return
    nearest, farthest = max(aw, bw, cw), min(aw, bw, cw)
    w_dx = ((bw - aw) * (cy - ay) - (cw - aw) * (by - ay)) / area
    w_dy = ((cw - aw) * (bx - ax) - (bw - aw) * (cx - ax)) / area
    for row in range(top, bottom + 1):
        e, e_dx = _edge(bx - ax, by - ay, ax, ay, row)
        f, f_dx = _edge(cx - bx, cy - by, bx, by, row)
        g, g_dx = _edge(ax - cx, ay - cy, cx, cy, row)
        first, last = left, right
        if right - left < _NARROW:  # cheaper than the divisions of three spans
            while (
                first <= last and (e + e_dx * first) | (f + f_dx * first) | (g + g_dx * first) < 0
            ):
                first += 1
            while last > first and (e + e_dx * last) | (f + f_dx * last) | (g + g_dx * last) < 0:
                last -= 1
        else:
            first, last = _row_span(e, e_dx, first, last)
            first, last = _row_span(f, f_dx, first, last)
            first, last = _row_span(g, g_dx, first, last)
        for column in range(first, last + 1):
            w = aw + w_dx * (column * SUBPIXELS - ax) + w_dy * (row * SUBPIXELS - ay)
            # Slivers have steep planes: stay within the corners.
            z = np.float32(1.0 / min(max(w, farthest), nearest))
            if z < depth[row, column]:
                depth[row, column] = z
                parts[row, column] = label


@kernel
def _fill_clipped(corners, label, matrix, near, cull, parts, depth):
    """Draws the part of a triangle (3, 3) in front of the near plane."""
    x, y, w = np.empty(4, np.int64), np.empty(4, np.int64), np.empty(4)
    count = 0
    for i in range(3):
        j = (i + 1) % 3
        inside, next_inside = corners[i, 2] >= near, corners[j, 2] >= near
        for crossing in range(2):
            if (crossing == 0 and not inside) or (crossing == 1 and inside == next_inside):
                continue
            px, py = np.float64(corners[i, 0]), np.float64(corners[i, 1])
            pz = np.float64(corners[i, 2])
            if crossing == 1:
                # From the inner to the outer corner whatever the winding, so that neighbours cut at
                # the same point.
                inner, outer = (i, j) if inside else (j, i)
                fraction = (corners[inner, 2] - near) / (corners[inner, 2] - corners[outer, 2])
                px = corners[inner, 0] + fraction * (corners[outer, 0] - corners[inner, 0])
                py = corners[inner, 1] + fraction * (corners[outer, 1] - corners[inner, 1])
                pz = near
            x[count] = _to_screen((matrix[0, 0] * px + matrix[0, 1] * py) / pz + matrix[0, 2])
            y[count] = _to_screen(matrix[1, 1] * py / pz + matrix[1, 2])
            w[count] = 1.0 / pz
            count += 1
    for k in range(2, count):
        a, b, c = (x[0], y[0], w[0]), (x[k - 1], y[k - 1], w[k - 1]), (x[k], y[k], w[k])
        _fill(*a, *b, *c, label, cull, parts, depth)


@kernel
def draw(vertices, faces, face_part, matrix, near, cull, parts, depth):
    """Draws all faces into `parts` (0 where empty) and `depth` (infinite where empty)."""
    count = len(vertices)
    x, y, w = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count)
    for i in range(count):
        vx, vy = np.float64(vertices[i, 0]), np.float64(vertices[i, 1])
        vz = np.float64(vertices[i, 2])
        x[i], y[i], w[i] = 0, 0, 0.0
        if not np.isfinite(vx + vy + vz):
            w[i] = -1.0
        elif vz >= near:
            x[i] = _to_screen((matrix[0, 0] * vx + matrix[0, 1] * vy) / vz + matrix[0, 2])
            y[i] = _to_screen(matrix[1, 1] * vy / vz + matrix[1, 2])
            w[i] = 1.0 / vz
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        least, most = min(w[a], w[b], w[c]), max(w[a], w[b], w[c])
        if least < 0.0 or most == 0.0:
            continue
        label = np.uint8(face_part[f] + 1)
        if least > 0.0:
            _fill(x[a], y[a], w[a], x[b], y[b], w[b], x[c], y[c], w[c], label, cull, parts, depth)
        else:
            corners = np.empty((3, 3))
            for k in range(3):
                corners[0, k], corners[1, k], corners[2, k] = (
                    vertices[a, k],
                    vertices[b, k],
                    vertices[c, k],
                )
            _fill_clipped(corners, label, matrix, near, cull, parts, depth)


@parallel_kernel
def draw_many(vertices, faces, face_part, matrix, near, cull, parts):
    """Draws every pose (N, V, 3) into its own image of `parts` (N, h, w), with face_part (N, F) or,
    for all of them, (1, F); the depth buffers are discarded.
    """
    for n in prange(len(vertices)):
        depth = np.full(parts.shape[1:], np.inf, np.float32)
        colouring = 0 if len(face_part) == 1 else np.int64(n)
        draw(vertices[n], faces, face_part[colouring], matrix, near, cull, parts[n], depth)
