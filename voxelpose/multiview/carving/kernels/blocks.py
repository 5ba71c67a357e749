"""Visual hull by hierarchical carving, from large blocks of voxels to single ones.

A camera is a row of float64 (layout below, filled by `multiview.carving.views`), a set of cameras a
bit mask, and a block is given by its lowest voxel. A mixed block is split into eight, and each
camera classifies all eight at once, without branches.

Source: shape from silhouette as in Laurentini, "The visual hull concept for silhouette-based image
understanding" (1994); octree refinement as in Szeliski, "Rapid octree construction from image
sequences" (1993). The summed-area test and the bounds under lens distortion are ours. Reference:
`tests.oracles.carving.carve_blocks`, every voxel in every camera, equal bit for bit.
"""

import math

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange

LARGEST, LEAF = 32, 4  # edges of blocks, voxels
_LEAF_VOXELS = LEAF**3
_CHUNKS = 64  # of the parallel loop: fixed, so that nothing depends on the number of threads
_DEEPEST = 32  # blocks that may wait at once while one of the largest is split

PINHOLE, RATIONAL, FISHEYE = 0, 1, 2

# Columns of a camera's row; the first twelve are K [R | t] of a pinhole camera, and [R | t] of any
# other.
FX, SKEW, CX, FY, CY, K1, K2, P1, P2, K3, K4, K5, K6, S1, S2, S3, S4, TILT = range(12, 30)
FIELD_SQUARED, SEEN_RADIUS, REACH, COLUMNS = range(TILT + 9, TILT + 13)  # TILT: row by row

# Columns of a camera's frame: its image; the crop, which is the box of its foreground and unknown
# places and one pixel around; where that starts in pixels and in sums; what a pixel in the
# foreground counts in the sums.
WIDTH, HEIGHT, LEFT, UPPER, WIDE, HIGH, PIXELS, SUMS, COUNTS = range(9)

# Verdict of one camera on a voxel, or on all voxels of a block. UNCLEAR: they differ, but all are
# visible. CUT: some may not be visible. BLIND is also what a voxel adds to the votes of a leaf:
# cameras that agree are counted below it, those that do not see the voxel above; and the value of a
# pixel of which nothing is known.
OBJECTS, AGREES, UNCLEAR, CUT, BLIND = 0, 1, 2, 3, 64
_BLIND_BITS = 6
_UNSEEN = 2  # position of a pixel that is BLIND


@kernel
def _distort_unbounded(rows, c, kind, x, y):
    """Distorts ideal coordinates; operations and order are those of the reference."""
    row = rows[c]
    s = x * x + y * y
    if kind == FISHEYE:
        radius = math.sqrt(s)
        if radius < 1e-8:
            return x, y
        angle = math.atan(radius)
        t = angle * angle
        ratio = angle * (1.0 + t * (row[K1] + t * (row[K2] + t * (row[K3] + t * row[K4])))) / radius
        return x * ratio, y * ratio
    below = 1.0 + s * (row[K4] + s * (row[K5] + s * row[K6]))
    ratio = (1.0 + s * (row[K1] + s * (row[K2] + s * row[K3]))) / below
    xy = 2.0 * x * y
    a = x * ratio + (row[P1] * xy + row[P2] * (s + 2.0 * x * x)) + s * (row[S1] + s * row[S2])
    b = y * ratio + (row[P1] * (s + 2.0 * y * y) + row[P2] * xy) + s * (row[S3] + s * row[S4])
    if row[TILT] != 0.0:
        u = (row[TILT] * a + row[TILT + 1] * b) + row[TILT + 2]
        v = (row[TILT + 3] * a + row[TILT + 4] * b) + row[TILT + 5]
        w = (row[TILT + 6] * a + row[TILT + 7] * b) + row[TILT + 8]
        a, b = u / w, v / w
    return a, b


@kernel
def _pinhole_boxes(rows, c, centres, half, seen, boxes):
    """Bounds the images of eight cubes, given by their centres (3, 8) and half their edge.

    Fills seen (8,): BLIND or CUT, or AGREES where boxes (4, 8) holds left, right, top and bottom,
    px, and all points project in between.
    """
    u_x, u_y, u_z, u_1 = rows[c, 0], rows[c, 1], rows[c, 2], rows[c, 3]
    v_x, v_y, v_z, v_1 = rows[c, 4], rows[c, 5], rows[c, 6], rows[c, 7]
    w_x, w_y, w_z, w_1 = rows[c, 8], rows[c, 9], rows[c, 10], rows[c, 11]
    depth = (abs(w_x) + abs(w_y) + abs(w_z)) * half
    near_m = 1e-3  # by which a block must be in front of the camera for its image to be bounded
    for n in range(centres.shape[1]):
        x, y, z = centres[0, n], centres[1, n], centres[2, n]
        w = w_x * x + w_y * y + w_z * z + w_1
        near = w - depth
        before = near >= near_m
        inverse, nearest = 1.0 / (w if before else 1.0), half / (near if before else 1.0)
        u = (u_x * x + u_y * y + u_z * z + u_1) * inverse
        v = (v_x * x + v_y * y + v_z * z + v_1) * inverse
        # U / W - u = (U - u W) / W: the numerator is affine and zero in the centre, the denominator
        # is at least w - depth.
        du = (abs(u_x - u * w_x) + abs(u_y - u * w_y) + abs(u_z - u * w_z)) * nearest
        dv = (abs(v_x - v * w_x) + abs(v_y - v * w_y) + abs(v_z - v * w_z)) * nearest
        boxes[0, n] = u - du
        boxes[1, n] = u + du
        boxes[2, n] = v - dv
        boxes[3, n] = v + dv
    for n in range(8):
        w = w_x * centres[0, n] + w_y * centres[1, n] + w_z * centres[2, n] + w_1
        behind = BLIND if w + depth < -1e-9 else CUT
        seen[n] = AGREES if w - depth >= near_m else behind


@kernel
def _lens_boxes(rows, kinds, bounds, c, seen, boxes):
    """Turns boxes of ideal coordinates, as `_pinhole_boxes` fills them for [R | t], into pixels."""
    for n in range(8):
        if seen[n] != AGREES:
            continue
        left, right, top, bottom = boxes[0, n], boxes[1, n], boxes[2, n], boxes[3, n]
        x_near, y_near = max(0.0, max(left, -right)), max(0.0, max(top, -bottom))
        if math.sqrt(x_near * x_near + y_near * y_near) > rows[c, SEEN_RADIUS]:
            seen[n] = BLIND
            continue
        x_far, y_far = max(-left, right), max(-top, bottom)
        farthest = math.sqrt(x_far * x_far + y_far * y_far)
        if farthest >= rows[c, REACH]:
            seen[n] = CUT
            continue
        # Mean value theorem: bounds the distance between the images of a point and of the box's
        # centre over a disc where |J| <= steep and |J - 1| <= change.
        bins = bounds.shape[2]
        disc = min(bins - 1, int(farthest / rows[c, REACH] * bins))
        steep, change = bounds[c, 0, disc], bounds[c, 1, disc]
        dx, dy = 0.5 * (right - left), 0.5 * (bottom - top)
        reach = math.sqrt(dx * dx + dy * dy)
        a, b = _distort_unbounded(rows, c, kinds[c], 0.5 * (left + right), 0.5 * (top + bottom))
        da, db = min(dx + change * reach, steep * reach), min(dy + change * reach, steep * reach)
        u, v = rows[c, FX] * a + rows[c, SKEW] * b + rows[c, CX], rows[c, FY] * b + rows[c, CY]
        du, dv = rows[c, FX] * da + abs(rows[c, SKEW]) * db, rows[c, FY] * db
        boxes[0, n], boxes[1, n], boxes[2, n], boxes[3, n] = u - du, u + du, v - dv, v + dv


@kernel
def _judge(frames, sums, c, seen, boxes):
    """Replaces AGREES in seen (8,) by the verdict on all pixels in boxes (4, 8)."""
    width, height = float(frames[c, WIDTH]), float(frames[c, HEIGHT])
    wide, high, first = np.int32(frames[c, WIDE]), np.int32(frames[c, HIGH]), frames[c, SUMS]
    left_crop, upper_crop = np.int32(frames[c, LEFT]), np.int32(frames[c, UPPER])
    line, counts = frames[c, WIDE] + 1, np.int32(frames[c, COUNTS])
    for n in range(8):
        pad_px = 1e-3  # rounding of the block's image, many times over
        left, right = boxes[0, n] + (0.5 - pad_px), boxes[1, n] + (0.5 + pad_px)
        top, bottom = boxes[2, n] + (0.5 - pad_px), boxes[3, n] + (0.5 + pad_px)
        outside = (right < 0.0) | (bottom < 0.0) | (left >= width) | (top >= height)
        whole = (left >= 0.0) & (top >= 0.0) & (right < width) & (bottom < height)
        # Inside the image these are not negative, so that truncation rounds down; elsewhere they do
        # not count.
        west = np.int32(left if whole else 0.0) - left_crop
        east = np.int32(right if whole else 0.0) + np.int32(1) - left_crop
        north = np.int32(top if whole else 0.0) - upper_crop
        south = np.int32(bottom if whole else 0.0) + np.int32(1) - upper_crop
        area = (east - west) * (south - north) * counts
        west, east = min(max(west, np.int32(0)), wide), min(max(east, np.int32(0)), wide)
        north, south = min(max(north, np.int32(0)), high), min(max(south, np.int32(0)), high)
        upper, lower = first + north * line, first + south * line
        # Counted modulo 2^16, which is enough where the box has fewer pixels; half the memory is
        # half the traffic between cores. An unknown pixel counts half of one in the foreground.
        count = (np.int32(sums[lower + east]) - sums[lower + west]) - (
            np.int32(sums[upper + east]) - sums[upper + west]
        )
        inside = count & np.int32(0xFFFF)
        verdict = OBJECTS if inside == 0 else (AGREES if inside == area else UNCLEAR)
        verdict = verdict if area <= 0xFFFF else UNCLEAR
        verdict = verdict if whole else (BLIND if outside else CUT)
        seen[n] = verdict if seen[n] == AGREES else seen[n]


@kernel
def _visible_positions(rows, frames, c, points, positions):
    """Fills positions (LEAF^3,) uint32, in `pixels`, of a leaf that a pinhole sees as a whole."""
    u_x, u_y, u_z, u_1 = rows[c, 0], rows[c, 1], rows[c, 2], rows[c, 3]
    v_x, v_y, v_z, v_1 = rows[c, 4], rows[c, 5], rows[c, 6], rows[c, 7]
    w_x, w_y, w_z, w_1 = rows[c, 8], rows[c, 9], rows[c, 10], rows[c, 11]
    left, upper = np.int32(frames[c, LEFT]), np.int32(frames[c, UPPER])
    wide = np.int32(frames[c, WIDE])
    right, lower = left + wide - np.int32(1), upper + np.int32(frames[c, HIGH]) - np.int32(1)
    first = np.int32(frames[c, PIXELS])
    for n in range(_LEAF_VOXELS):
        x, y, z = points[0, n], points[1, n], points[2, n]
        inverse = 1.0 / (((w_x * x + w_y * y) + w_1) + w_z * z)
        u = (((u_x * x + u_y * y) + u_1) + u_z * z) * inverse + 0.5
        v = (((v_x * x + v_y * y) + v_1) + v_z * z) * inverse + 0.5
        # Not negative, so that truncation rounds down: the nearest pixel centre, ties upward.
        # Beyond the crop is its empty rim.
        column, line = min(max(np.int32(u), left), right), min(max(np.int32(v), upper), lower)
        positions[n] = first + (line - upper) * wide + (column - left)


@kernel
def _positions(rows, kinds, frames, c, points, positions):
    """Fills positions as `_visible_positions`, for any camera and any voxels: 0 (OBJECTS) beyond
    the crop, that of BLIND where a voxel is not visible.
    """
    width, height = float(frames[c, WIDTH]), float(frames[c, HEIGHT])
    for n in range(_LEAF_VOXELS):
        x, y, z = points[0, n], points[1, n], points[2, n]
        positions[n] = _UNSEEN
        w = ((rows[c, 8] * x + rows[c, 9] * y) + rows[c, 11]) + rows[c, 10] * z
        if not w > 0.0:
            continue
        inverse = 1.0 / w
        u = (((rows[c, 0] * x + rows[c, 1] * y) + rows[c, 3]) + rows[c, 2] * z) * inverse
        v = (((rows[c, 4] * x + rows[c, 5] * y) + rows[c, 7]) + rows[c, 6] * z) * inverse
        if kinds[c] != PINHOLE:
            if u * u + v * v > rows[c, FIELD_SQUARED]:
                continue
            a, b = _distort_unbounded(rows, c, kinds[c], u, v)
            u = (rows[c, FX] * a + rows[c, SKEW] * b) + rows[c, CX]
            v = rows[c, FY] * b + rows[c, CY]
        u, v = u + 0.5, v + 0.5
        if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
            continue
        column, line = int(u) - frames[c, LEFT], int(v) - frames[c, UPPER]
        known = column >= 0 and line >= 0 and column < frames[c, WIDE] and line < frames[c, HIGH]
        positions[n] = frames[c, PIXELS] + line * frames[c, WIDE] + column if known else 0


@kernel
def _carve_leaf(cameras, rule, axes, occupancy, block, state, scratch):
    """Decides a leaf voxel by voxel."""
    rows, kinds, _, frames, _, pixels = cameras
    _, _, _, _, _, positions, votes, points = scratch
    tolerance, least = rule
    xs, ys, zs = axes
    i0, j0, k0 = block
    unclear, cut, agreeing, objecting = state
    for n in range(_LEAF_VOXELS):
        points[0, n] = xs[i0 + n // (LEAF * LEAF)]
        points[1, n] = ys[j0 + n // LEAF % LEAF]
        points[2, n] = zs[k0 + n % LEAF]
        votes[n] = 0
    voting = 0
    for c in range(len(kinds)):
        if not (unclear >> c) & 1:
            continue
        voting += 1
        if kinds[c] == PINHOLE and not (cut >> c) & 1:
            _visible_positions(rows, frames, c, points, positions)
        else:
            _positions(rows, kinds, frames, c, points, positions)
        for n in range(_LEAF_VOXELS):
            votes[n] += pixels[positions[n]]
    enough_agree = least - agreeing
    enough_unopposed = objecting + voting - tolerance
    for i in range(min(LEAF, occupancy.shape[0] - i0)):
        for j in range(min(LEAF, occupancy.shape[1] - j0)):
            for k in range(min(LEAF, occupancy.shape[2] - k0)):
                vote = votes[(i * LEAF + j) * LEAF + k]
                agree = vote & (BLIND - 1)
                unopposed = agree + (vote >> _BLIND_BITS)
                occupancy[i0 + i, j0 + j, k0 + k] = (agree >= enough_agree) & (
                    unopposed >= enough_unopposed
                )


@kernel
def _classify_children(cameras, rule, parent, half, scratch):
    """Fills states (4, 8) of a block's children: bits of the cameras that are UNCLEAR or CUT, bits
    of those that are CUT, numbers of those that agree and object.
    """
    rows, kinds, bounds, frames, sums, _ = cameras
    _, centres, seen, boxes, states, _, _, _ = scratch
    tolerance, _ = rule
    for n in range(8):
        states[0, n], states[1, n], states[2, n], states[3, n] = 0, 0, parent[2], parent[3]
    for c in range(len(kinds)):
        if not (parent[0] >> c) & 1:
            continue
        _pinhole_boxes(rows, c, centres, half, seen, boxes)
        if kinds[c] != PINHOLE:
            _lens_boxes(rows, kinds, bounds, c, seen, boxes)
        _judge(frames, sums, c, seen, boxes)
        bit = np.int64(1) << c
        alive = 0
        for n in range(8):
            verdict = seen[n]
            states[0, n] |= bit if (verdict == UNCLEAR) | (verdict == CUT) else 0
            states[1, n] |= bit if verdict == CUT else 0
            states[2, n] += verdict == AGREES
            states[3, n] += verdict == OBJECTS
            alive += states[3, n] <= tolerance
        if not alive:
            break


@kernel
def _count_bits(cameras):
    """Counts a set of cameras."""
    count = 0
    while cameras:
        cameras &= cameras - 1
        count += 1
    return count


@kernel
def _carve_largest(cameras, rule, axes, occupancy, largest, scratch):
    """Splits one of the largest blocks as far as it is mixed."""
    tolerance, least = rule
    stack, centres, _, _, states, _, _, _ = scratch
    xs, ys, zs = axes
    nx, ny, nz = occupancy.shape
    for column in range(8):
        stack[0, column] = largest[column]
    waiting = 1
    while waiting:
        waiting -= 1
        i0, j0, k0 = stack[waiting, 0], stack[waiting, 1], stack[waiting, 2]
        edge = stack[waiting, 3] // 2
        parent = (stack[waiting, 4], stack[waiting, 5], stack[waiting, 6], stack[waiting, 7])
        half = 0.5 * (xs[i0 + edge - 1] - xs[i0])
        for n in range(8):
            i, j, k = i0 + (n >> 2) * edge, j0 + (n >> 1 & 1) * edge, k0 + (n & 1) * edge
            centres[0, n], centres[1, n], centres[2, n] = xs[i] + half, ys[j] + half, zs[k] + half
        _classify_children(cameras, rule, parent, half, scratch)
        for n in range(8):
            i, j, k = i0 + (n >> 2) * edge, j0 + (n >> 1 & 1) * edge, k0 + (n & 1) * edge
            state = (states[0, n], states[1, n], states[2, n], states[3, n])
            unclear, _, agreeing, objecting = state
            if i >= nx or j >= ny or k >= nz or objecting > tolerance:
                continue
            undecided = _count_bits(unclear)
            if agreeing + undecided < least:
                continue
            if agreeing >= least and objecting + undecided <= tolerance:
                occupancy[i : i + edge, j : j + edge, k : k + edge] = True
            elif edge == LEAF:
                _carve_leaf(cameras, rule, axes, occupancy, (i, j, k), state, scratch)
            else:
                for column, value in enumerate((i, j, k, edge, *state)):
                    stack[waiting, column] = value
                waiting += 1


@kernel
def _carve_chunk(chunk, cameras, rule, axes, order, occupancy):
    """Carves one of _CHUNKS parts of the largest blocks."""
    everyone = (np.int64(1) << len(cameras[0])) - 1
    ny, nz = len(axes[1]) // LARGEST, len(axes[2]) // LARGEST
    scratch = (
        np.empty((_DEEPEST, 8), np.int64),
        np.empty((3, 8)),
        np.empty(8, np.int64),
        np.empty((4, 8)),
        np.empty((4, 8), np.int64),
        np.empty(_LEAF_VOXELS, np.uint32),
        np.empty(_LEAF_VOXELS, np.int32),
        np.empty((3, _LEAF_VOXELS)),
    )
    for t in range(chunk * len(order) // _CHUNKS, (chunk + 1) * len(order) // _CHUNKS):
        n = order[t]
        i, j, k = n // (ny * nz) * LARGEST, n // nz % ny * LARGEST, n % nz * LARGEST
        largest = (i, j, k, LARGEST, everyone, 0, 0, 0)
        _carve_largest(cameras, rule, axes, occupancy, largest, scratch)


@parallel_kernel
def carve_blocks(rows, kinds, bounds, frames, sums, pixels, rule, axes, order, occupancy):
    """Carves a grid, each of its largest blocks on its own.

    Args:
        rows: (C, COLUMNS) float64, cameras.
        kinds: (C,) int64, PINHOLE, RATIONAL or FISHEYE.
        bounds: (C, 2, bins) float64, largest norms of a lens's Jacobian and of its difference from
            the identity, up to a radius.
        frames: (C, 9) int64, images and crops.
        sums: (S,) uint16, summed-area tables of all crops, (HIGH + 1) * (WIDE + 1) each, modulo
            2^16: of pixels in the foreground, or of twice those and of unknown ones.
        pixels: (P,) uint8, OBJECTS, AGREES or, unknown, BLIND; the first three are these, then come
            all crops.
        rule: most cameras that may object, fewest that must agree.
        axes: centres of the voxels along x, y and z, float64, m, continued to a multiple of
            LARGEST.
        order: (N,) int64, order in which the N largest blocks are carved.
        occupancy: (nx, ny, nz) bool, all False; filled, each block its own voxels.
    """
    cameras = (rows, kinds, bounds, frames, sums, pixels)
    for chunk in prange(_CHUNKS):
        # prange counts in uint64, which would be compiled as well.
        _carve_chunk(np.int64(chunk), cameras, rule, axes, order, occupancy)
