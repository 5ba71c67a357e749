"""Carving from large blocks to small ones; see `voxelpose.carving.carver.carve` for the rule and
`..reference` for its plain form.

A camera is a row of float64 (layout: `..views`), a set of cameras a bit mask, and a block is known
by its lowest voxel. A mixed block is taken apart into eight, and each camera is asked for all eight
at once, without branches.
"""

import math

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange

LARGEST, LEAF = 32, 4  # edges of blocks, voxels
_LEAF_VOXELS = LEAF**3
# of the parallel loop; a fixed number, so that nothing depends on how many threads there are
_CHUNKS = 64
_DEEPEST = 32  # blocks that may wait at once while one of the largest is taken apart

PINHOLE, RATIONAL, FISHEYE = 0, 1, 2

# Columns of a camera's row; the first twelve are K [R | t] of a pinhole camera, and [R | t] of any
# other.
FX, SKEW, CX, FY, CY = 12, 13, 14, 15, 16
K1, K2, P1, P2, K3, K4, K5, K6 = 17, 18, 19, 20, 21, 22, 23, 24
S1, S2, S3, S4 = 25, 26, 27, 28
TILT = 29  # nine numbers, row by row
FIELD_SQUARED, SEEN_RADIUS, REACH = 38, 39, 40
COLUMNS = 41

# Columns of a camera's frame: its image; the crop, which is the box of its foreground and one pixel
# around; where that starts.
WIDTH, HEIGHT, LEFT, UPPER, WIDE, HIGH, PIXELS, SUMS = 0, 1, 2, 3, 4, 5, 6, 7

# What one camera says of a voxel, or of all voxels of a block. UNCLEAR: they differ, but it sees
# all of them. CUT: it may not see some. BLIND is also what a voxel adds to the votes of a leaf:
# cameras that agree are counted below it, those that do not see above.
OBJECTS, AGREES, UNCLEAR, CUT, BLIND = 0, 1, 2, 3, 64
_BLIND_BITS = 6

_NEAR_M = 1e-3  # a block must be in front of the camera by this for its image to be bounded
_PAD_PX = 1e-3  # rounding of the block's image, many times over
_DEPTH_ERROR_M = 1e-9


@kernel
def distort_unbounded(rows, c, kind, x, y):
    """Distorts ideal coordinates; the operations and their order are those of
    `reference.distort_unbounded`.
    """
    s = x * x + y * y
    if kind == FISHEYE:
        radius = math.sqrt(s)
        if radius < 1e-8:
            return x, y
        angle = math.atan(radius)
        t = angle * angle
        ratio = (
            angle
            * (1.0 + t * (rows[c, K1] + t * (rows[c, K2] + t * (rows[c, K3] + t * rows[c, K4]))))
            / radius
        )
        return x * ratio, y * ratio
    below = 1.0 + s * (rows[c, K4] + s * (rows[c, K5] + s * rows[c, K6]))
    ratio = (1.0 + s * (rows[c, K1] + s * (rows[c, K2] + s * rows[c, K3]))) / below
    xy = 2.0 * x * y
    a = (
        x * ratio
        + (rows[c, P1] * xy + rows[c, P2] * (s + 2.0 * x * x))
        + s * (rows[c, S1] + s * rows[c, S2])
    )
    b = (
        y * ratio
        + (rows[c, P1] * (s + 2.0 * y * y) + rows[c, P2] * xy)
        + s * (rows[c, S3] + s * rows[c, S4])
    )
    if rows[c, TILT] != 0.0:
        u = (rows[c, TILT] * a + rows[c, TILT + 1] * b) + rows[c, TILT + 2]
        v = (rows[c, TILT + 3] * a + rows[c, TILT + 4] * b) + rows[c, TILT + 5]
        w = (rows[c, TILT + 6] * a + rows[c, TILT + 7] * b) + rows[c, TILT + 8]
        a, b = u / w, v / w
    return a, b


@kernel
def _pinhole_boxes(rows, c, middles, half, seen, boxes):
    """Bounds the images of eight boxes of points, given by their middles (3, 8) and half their
    edge.

    Fills seen (8,): BLIND or CUT, or AGREES where boxes (4, 8) holds left, right, top and bottom,
        px, and all points project in between.
    """
    u_x, u_y, u_z, u_1 = rows[c, 0], rows[c, 1], rows[c, 2], rows[c, 3]
    v_x, v_y, v_z, v_1 = rows[c, 4], rows[c, 5], rows[c, 6], rows[c, 7]
    w_x, w_y, w_z, w_1 = rows[c, 8], rows[c, 9], rows[c, 10], rows[c, 11]
    depth = (abs(w_x) + abs(w_y) + abs(w_z)) * half
    for n in range(middles.shape[1]):
        x, y, z = middles[0, n], middles[1, n], middles[2, n]
        w = w_x * x + w_y * y + w_z * z + w_1
        near = w - depth
        before = near >= _NEAR_M
        inverse, nearest = 1.0 / (w if before else 1.0), half / (near if before else 1.0)
        u = (u_x * x + u_y * y + u_z * z + u_1) * inverse
        v = (v_x * x + v_y * y + v_z * z + v_1) * inverse
        # U / W - u = (U - u W) / W: the numerator is affine and zero in the middle, the denominator
        # is at least w - depth.
        du = (abs(u_x - u * w_x) + abs(u_y - u * w_y) + abs(u_z - u * w_z)) * nearest
        dv = (abs(v_x - v * w_x) + abs(v_y - v * w_y) + abs(v_z - v * w_z)) * nearest
        boxes[0, n] = u - du
        boxes[1, n] = u + du
        boxes[2, n] = v - dv
        boxes[3, n] = v + dv
    for n in range(8):
        w = w_x * middles[0, n] + w_y * middles[1, n] + w_z * middles[2, n] + w_1
        seen[n] = (
            AGREES if w - depth >= _NEAR_M else (BLIND if w + depth < -_DEPTH_ERROR_M else CUT)
        )


@kernel
def _lens_boxes(rows, kinds, bounds, c, seen, boxes):
    """Turns boxes of ideal coordinates, as `_pinhole_boxes` fills them for a camera that is no more
    than [R | t], into pixels.
    """
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
        # Mean value theorem: over a disc where |J| <= steep and |J - 1| <= change, a point's image
        # is no farther from the middle's.
        bins = bounds.shape[2]
        place = min(bins - 1, int(farthest / rows[c, REACH] * bins))
        steep, change = bounds[c, 0, place], bounds[c, 1, place]
        dx, dy = 0.5 * (right - left), 0.5 * (bottom - top)
        reach = math.sqrt(dx * dx + dy * dy)
        a, b = distort_unbounded(rows, c, kinds[c], 0.5 * (left + right), 0.5 * (top + bottom))
        da, db = min(dx + change * reach, steep * reach), min(dy + change * reach, steep * reach)
        u, v = rows[c, FX] * a + rows[c, SKEW] * b + rows[c, CX], rows[c, FY] * b + rows[c, CY]
        du, dv = rows[c, FX] * da + abs(rows[c, SKEW]) * db, rows[c, FY] * db
        boxes[0, n], boxes[1, n], boxes[2, n], boxes[3, n] = u - du, u + du, v - dv, v + dv


@kernel
def _judge(frames, sums, c, seen, boxes):
    """Replaces AGREES in seen (8,) by what the camera says of all points whose pixels lie in the
    boxes (4, 8).
    """
    width, height = float(frames[c, WIDTH]), float(frames[c, HEIGHT])
    wide, high, first = np.int32(frames[c, WIDE]), np.int32(frames[c, HIGH]), frames[c, SUMS]
    left_crop, upper_crop = np.int32(frames[c, LEFT]), np.int32(frames[c, UPPER])
    line = frames[c, WIDE] + 1
    for n in range(8):
        left, right = boxes[0, n] + (0.5 - _PAD_PX), boxes[1, n] + (0.5 + _PAD_PX)
        top, bottom = boxes[2, n] + (0.5 - _PAD_PX), boxes[3, n] + (0.5 + _PAD_PX)
        outside = (right < 0.0) | (bottom < 0.0) | (left >= width) | (top >= height)
        whole = (left >= 0.0) & (top >= 0.0) & (right < width) & (bottom < height)
        # Inside the image these are not negative, so that truncation rounds down; elsewhere they do
        # not count.
        west = np.int32(left if whole else 0.0) - left_crop
        east = np.int32(right if whole else 0.0) + np.int32(1) - left_crop
        north = np.int32(top if whole else 0.0) - upper_crop
        south = np.int32(bottom if whole else 0.0) + np.int32(1) - upper_crop
        area = (east - west) * (south - north)
        west, east = min(max(west, np.int32(0)), wide), min(max(east, np.int32(0)), wide)
        north, south = min(max(north, np.int32(0)), high), min(max(south, np.int32(0)), high)
        upper, lower = first + north * line, first + south * line
        # Counted modulo 2^16, which is enough where the box has fewer pixels; half the memory is
        # half the traffic between cores.
        count = (np.int32(sums[lower + east]) - sums[lower + west]) - (
            np.int32(sums[upper + east]) - sums[upper + west]
        )
        inside = count & np.int32(0xFFFF)
        verdict = OBJECTS if inside == 0 else (AGREES if inside == area else UNCLEAR)
        verdict = verdict if area <= 0xFFFF else UNCLEAR
        verdict = verdict if whole else (BLIND if outside else CUT)
        seen[n] = verdict if seen[n] == AGREES else seen[n]


@kernel
def _whole_places(rows, frames, c, points, places):
    """Finds the pixels of a leaf's voxels, all of which a pinhole camera sees: places (LEAF^3,)
    uint32 in `pixels`.
    """
    u_x, u_y, u_z, u_1 = rows[c, 0], rows[c, 1], rows[c, 2], rows[c, 3]
    v_x, v_y, v_z, v_1 = rows[c, 4], rows[c, 5], rows[c, 6], rows[c, 7]
    w_x, w_y, w_z, w_1 = rows[c, 8], rows[c, 9], rows[c, 10], rows[c, 11]
    left, upper, wide = (
        np.int32(frames[c, LEFT]),
        np.int32(frames[c, UPPER]),
        np.int32(frames[c, WIDE]),
    )
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
        places[n] = first + (line - upper) * wide + (column - left)


@kernel
def _places(rows, kinds, frames, c, points, places):
    """Does the same for any camera and any voxels; a place is 0, which holds OBJECTS, beyond the
    crop, and 2, BLIND, if not seen.
    """
    width, height = float(frames[c, WIDTH]), float(frames[c, HEIGHT])
    for n in range(_LEAF_VOXELS):
        x, y, z = points[0, n], points[1, n], points[2, n]
        places[n] = 2
        w = ((rows[c, 8] * x + rows[c, 9] * y) + rows[c, 11]) + rows[c, 10] * z
        if not w > 0.0:
            continue
        inverse = 1.0 / w
        u = (((rows[c, 0] * x + rows[c, 1] * y) + rows[c, 3]) + rows[c, 2] * z) * inverse
        v = (((rows[c, 4] * x + rows[c, 5] * y) + rows[c, 7]) + rows[c, 6] * z) * inverse
        if kinds[c] != PINHOLE:
            if u * u + v * v > rows[c, FIELD_SQUARED]:
                continue
            a, b = distort_unbounded(rows, c, kinds[c], u, v)
            u, v = (
                (rows[c, FX] * a + rows[c, SKEW] * b) + rows[c, CX],
                rows[c, FY] * b + rows[c, CY],
            )
        u, v = u + 0.5, v + 0.5
        if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
            continue
        column, line = int(u) - frames[c, LEFT], int(v) - frames[c, UPPER]
        known = column >= 0 and line >= 0 and column < frames[c, WIDE] and line < frames[c, HIGH]
        places[n] = frames[c, PIXELS] + line * frames[c, WIDE] + column if known else 0


@kernel
def _carve_leaf(
    rows, kinds, frames, pixels, rule, axes, occupancy, block, state, places, votes, points
):
    """Decides a leaf voxel by voxel."""
    tolerance, least, outside = rule
    xs, ys, zs = axes
    i0, j0, k0 = block
    unclear, cut, agreeing, objecting = state
    for n in range(_LEAF_VOXELS):
        points[0, n], points[1, n], points[2, n] = (
            xs[i0 + n // (LEAF * LEAF)],
            ys[j0 + n // LEAF % LEAF],
            zs[k0 + n % LEAF],
        )
        votes[n] = 0
    asked = 0
    for c in range(len(kinds)):
        if not (unclear >> c) & 1:
            continue
        asked += 1
        if kinds[c] == PINHOLE and not (cut >> c) & 1:
            _whole_places(rows, frames, c, points, places)
        else:
            _places(rows, kinds, frames, c, points, places)
        for n in range(_LEAF_VOXELS):
            votes[n] += pixels[places[n]]
    enough_agree = least - agreeing
    enough_unopposed = objecting + asked - tolerance
    for i in range(min(LEAF, occupancy.shape[0] - i0)):
        for j in range(min(LEAF, occupancy.shape[1] - j0)):
            for k in range(min(LEAF, occupancy.shape[2] - k0)):
                vote = votes[(i * LEAF + j) * LEAF + k]
                agree = vote & (BLIND - 1)
                unopposed = agree if outside == OBJECTS else agree + (vote >> _BLIND_BITS)
                occupancy[i0 + i, j0 + j, k0 + k] = (agree >= enough_agree) & (
                    unopposed >= enough_unopposed
                )


@kernel
def _ask(rows, kinds, bounds, frames, sums, rule, parent, middles, half, seen, boxes, states):
    """Asks the cameras that have yet to speak of a block for its eight children: fills states (4,
    8).
    """
    tolerance, _, outside = rule
    for n in range(8):
        states[0, n], states[1, n], states[2, n], states[3, n] = 0, 0, parent[2], parent[3]
    for c in range(len(kinds)):
        if not (parent[0] >> c) & 1:
            continue
        _pinhole_boxes(rows, c, middles, half, seen, boxes)
        if kinds[c] != PINHOLE:
            _lens_boxes(rows, kinds, bounds, c, seen, boxes)
        _judge(frames, sums, c, seen, boxes)
        this = np.int64(1) << c
        alive = 0
        for n in range(8):
            verdict = outside if seen[n] == BLIND else seen[n]
            states[0, n] |= this if (verdict == UNCLEAR) | (verdict == CUT) else 0
            states[1, n] |= this if verdict == CUT else 0
            states[2, n] += verdict == AGREES
            states[3, n] += verdict == OBJECTS
            alive += states[3, n] <= tolerance
        if not alive:
            break


@kernel
def _fill(occupancy, i0, j0, k0, edge):
    """Sets a block."""
    nx, ny, nz = occupancy.shape
    for i in range(i0, min(i0 + edge, nx)):
        for j in range(j0, min(j0 + edge, ny)):
            for k in range(k0, min(k0 + edge, nz)):
                occupancy[i, j, k] = True


@kernel
def _count(cameras):
    """Counts a set of cameras."""
    count = 0
    while cameras:
        cameras &= cameras - 1
        count += 1
    return count


@kernel
def _carve_largest(
    rows, kinds, bounds, frames, sums, pixels, rule, axes, occupancy, largest, scratch
):
    """Takes one of the largest blocks apart, as far as it is mixed."""
    tolerance, least, _ = rule
    stack, middles, seen, boxes, states, places, votes, points = scratch
    xs, ys, zs = axes
    nx, ny, nz = occupancy.shape
    for column in range(8):
        stack[0, column] = largest[column]
    waiting = 1
    while waiting:
        waiting -= 1
        i0, j0, k0, edge = (
            stack[waiting, 0],
            stack[waiting, 1],
            stack[waiting, 2],
            stack[waiting, 3] // 2,
        )
        parent = (stack[waiting, 4], stack[waiting, 5], stack[waiting, 6], stack[waiting, 7])
        half = 0.5 * (xs[i0 + edge - 1] - xs[i0])
        for n in range(8):
            i, j, k = i0 + (n >> 2) * edge, j0 + (n >> 1 & 1) * edge, k0 + (n & 1) * edge
            middles[0, n], middles[1, n], middles[2, n] = xs[i] + half, ys[j] + half, zs[k] + half
        _ask(rows, kinds, bounds, frames, sums, rule, parent, middles, half, seen, boxes, states)
        for n in range(8):
            i, j, k = i0 + (n >> 2) * edge, j0 + (n >> 1 & 1) * edge, k0 + (n & 1) * edge
            unclear, cut, agreeing, objecting = (
                states[0, n],
                states[1, n],
                states[2, n],
                states[3, n],
            )
            if i >= nx or j >= ny or k >= nz or objecting > tolerance:
                continue
            undecided = _count(unclear)
            if agreeing + undecided < least:
                continue
            if agreeing >= least and objecting + undecided <= tolerance:
                _fill(occupancy, i, j, k, edge)
            elif edge == LEAF:
                state = (unclear, cut, agreeing, objecting)
                _carve_leaf(
                    rows,
                    kinds,
                    frames,
                    pixels,
                    rule,
                    axes,
                    occupancy,
                    (i, j, k),
                    state,
                    places,
                    votes,
                    points,
                )
            else:
                stack[waiting, 0], stack[waiting, 1], stack[waiting, 2], stack[waiting, 3] = (
                    i,
                    j,
                    k,
                    edge,
                )
                stack[waiting, 4], stack[waiting, 5], stack[waiting, 6], stack[waiting, 7] = (
                    unclear,
                    cut,
                    agreeing,
                    objecting,
                )
                waiting += 1


@parallel_kernel
def carve_blocks(rows, kinds, bounds, frames, sums, pixels, rule, axes, order, occupancy):
    """Carves.

    Args: rows: (C, COLUMNS) float64, cameras. kinds: (C,) int64, PINHOLE, RATIONAL or FISHEYE.
        bounds: (C, 2, bins) float64, how much a lens stretches, and how far it is from no lens, up
        to a radius. frames: (C, 8) int64, images and crops. sums: (S,) uint16, summed-area tables
        of all crops modulo 2^16, (HIGH + 1) * (WIDE + 1) each. pixels: (P,) uint8, OBJECTS or
        AGREES; the first three are OBJECTS, AGREES and BLIND, then come all crops. rule: most
        cameras that may object, least that must agree, what a camera says that does not see. axes:
        centres of the voxels along x, y and z, float64, m, continued to a multiple of LARGEST.
        order: (N,) int64, the order in which the N largest blocks are carved. occupancy: (nx, ny,
        nz) bool, all False, written: each block its own voxels.
    """
    ny, nz = len(axes[1]) // LARGEST, len(axes[2]) // LARGEST
    for chunk in prange(_CHUNKS):
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
            everyone = (np.int64(1) << len(rows)) - 1
            largest = (
                n // (ny * nz) * LARGEST,
                n // nz % ny * LARGEST,
                n % nz * LARGEST,
                LARGEST,
                everyone,
                0,
                0,
                0,
            )
            _carve_largest(
                rows, kinds, bounds, frames, sums, pixels, rule, axes, occupancy, largest, scratch
            )


@kernel
def _any(line):
    """Says whether anything in a row of uint8 is not zero, without stopping early: faster than
    stopping.
    """
    found = np.uint8(0)
    for x in range(len(line)):
        found |= line[x]
    return found != 0


@kernel
def foreground_box(mask):
    """Returns left, top, width and height of the box around all non-zero pixels of (h, w) uint8;
    zeros where there are none.
    """
    height, width = mask.shape
    top, bottom = 0, height
    while top < height and not _any(mask[top]):
        top += 1
    if top == height:
        return 0, 0, 0, 0
    while not _any(mask[bottom - 1]):
        bottom -= 1
    columns = np.zeros(width, np.uint8)
    for y in range(top, bottom):
        for x in range(width):
            columns[x] |= mask[y, x]
    left, right = 0, width
    while not columns[left]:
        left += 1
    while not columns[right - 1]:
        right -= 1
    return left, top, right - left, bottom - top
