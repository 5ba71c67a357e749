"""Carving from large blocks to small ones; see `voxelpose.carving.carver.carve` for the rule and `..reference` for its plain form.

A camera is a row of float64 (layout: `..views`), a set of cameras a bit mask, and a block is known by its lowest voxel.
"""

import math

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange

TOP, LEAF = 16, 4  # edges of the largest and the smallest blocks, voxels
_LEAF_VOXELS = LEAF**3
_CHUNKS = 128  # of the parallel loop; a fixed number, so that nothing depends on how many threads there are
_DEEPEST = 64  # blocks that may wait at once while one of TOP is taken apart

PINHOLE, RATIONAL, FISHEYE = 0, 1, 2

# Columns of a camera's row; the first twelve are K [R | t] of a pinhole camera, and [R | t] of any other.
FX, SKEW, CX, FY, CY = 12, 13, 14, 15, 16
K1, K2, P1, P2, K3, K4, K5, K6 = 17, 18, 19, 20, 21, 22, 23, 24
S1, S2, S3, S4 = 25, 26, 27, 28
TILT = 29  # nine numbers, row by row
FIELD_SQUARED, SEEN_RADIUS, REACH = 38, 39, 40
COLUMNS = 41

# Columns of a camera's frame: its image, the box of its foreground, and where that box's pixels and sums start.
WIDTH, HEIGHT, LEFT, UPPER, WIDE, HIGH, PIXELS, SUMS = 0, 1, 2, 3, 4, 5, 6, 7

# What one camera says of a voxel, or of all voxels of a block. BLIND is also what its voxels add to the votes of a leaf: there the
# cameras that agree are counted below it and those that do not see above it.
OBJECTS, AGREES, UNCLEAR, BLIND = 0, 1, 2, 64
_BLIND_BITS = 6

# What all cameras say of a block.
_EMPTY, _FULL, _MIXED = 0, 1, 2

_NEAR_M = 1e-3  # a block must be in front of the camera by this for its image to be bounded
_PAD_PX = 1e-3  # rounding of the block's image, many times over
_DEPTH_ERROR_M = 1e-9


@kernel
def bend(rows, c, kind, x, y):
    """Distorts ideal coordinates; the operations and their order are those of `reference.bend`."""
    s = x * x + y * y
    if kind == FISHEYE:
        radius = math.sqrt(s)
        if radius < 1e-8:
            return x, y
        angle = math.atan(radius)
        t = angle * angle
        ratio = angle * (1.0 + t * (rows[c, K1] + t * (rows[c, K2] + t * (rows[c, K3] + t * rows[c, K4])))) / radius
        return x * ratio, y * ratio
    below = 1.0 + s * (rows[c, K4] + s * (rows[c, K5] + s * rows[c, K6]))
    ratio = (1.0 + s * (rows[c, K1] + s * (rows[c, K2] + s * rows[c, K3]))) / below
    xy = 2.0 * x * y
    a = x * ratio + (rows[c, P1] * xy + rows[c, P2] * (s + 2.0 * x * x)) + s * (rows[c, S1] + s * rows[c, S2])
    b = y * ratio + (rows[c, P1] * (s + 2.0 * y * y) + rows[c, P2] * xy) + s * (rows[c, S3] + s * rows[c, S4])
    if rows[c, TILT] != 0.0:
        u = (rows[c, TILT] * a + rows[c, TILT + 1] * b) + rows[c, TILT + 2]
        v = (rows[c, TILT + 3] * a + rows[c, TILT + 4] * b) + rows[c, TILT + 5]
        w = (rows[c, TILT + 6] * a + rows[c, TILT + 7] * b) + rows[c, TILT + 8]
        a, b = u / w, v / w
    return a, b


@kernel
def _image_box(rows, kinds, bounds, c, middle, half):
    """Bounds the image of a box of points given by its middle and half its edges.

    Returns UNCLEAR or BLIND, or AGREES with the middle's pixel and how far from it, along the two axes, the image may reach.
    """
    x, y, z = middle
    w = rows[c, 8] * x + rows[c, 9] * y + rows[c, 10] * z + rows[c, 11]
    depth = abs(rows[c, 8]) * half[0] + abs(rows[c, 9]) * half[1] + abs(rows[c, 10]) * half[2]
    if w + depth < -_DEPTH_ERROR_M:
        return BLIND, 0.0, 0.0, 0.0, 0.0
    if w - depth < _NEAR_M:
        return UNCLEAR, 0.0, 0.0, 0.0, 0.0
    u = (rows[c, 0] * x + rows[c, 1] * y + rows[c, 2] * z + rows[c, 3]) / w
    v = (rows[c, 4] * x + rows[c, 5] * y + rows[c, 6] * z + rows[c, 7]) / w
    # U / W - u = (U - u W) / W: the numerator is affine and zero in the middle, the denominator is at least w - depth.
    nearest = 1.0 / (w - depth)
    du = (
        abs(rows[c, 0] - u * rows[c, 8]) * half[0]
        + abs(rows[c, 1] - u * rows[c, 9]) * half[1]
        + abs(rows[c, 2] - u * rows[c, 10]) * half[2]
    ) * nearest
    dv = (
        abs(rows[c, 4] - v * rows[c, 8]) * half[0]
        + abs(rows[c, 5] - v * rows[c, 9]) * half[1]
        + abs(rows[c, 6] - v * rows[c, 10]) * half[2]
    ) * nearest
    if kinds[c] == PINHOLE:
        return AGREES, u, v, du, dv
    x_near, y_near = max(0.0, abs(u) - du), max(0.0, abs(v) - dv)
    if math.sqrt(x_near * x_near + y_near * y_near) > rows[c, SEEN_RADIUS]:
        return BLIND, 0.0, 0.0, 0.0, 0.0
    x_far, y_far = abs(u) + du, abs(v) + dv
    farthest = math.sqrt(x_far * x_far + y_far * y_far)
    if farthest >= rows[c, REACH]:
        return UNCLEAR, 0.0, 0.0, 0.0, 0.0
    # Mean value theorem: over a disc where |J| <= steep and |J - 1| <= change, a point moves from the middle's image by no more.
    place = min(bounds.shape[2] - 1, int(farthest / rows[c, REACH] * bounds.shape[2]))
    steep, change = bounds[c, 0, place], bounds[c, 1, place]
    reach = math.sqrt(du * du + dv * dv)
    a, b = bend(rows, c, kinds[c], u, v)
    da, db = min(du + change * reach, steep * reach), min(dv + change * reach, steep * reach)
    u = rows[c, FX] * a + rows[c, SKEW] * b + rows[c, CX]
    v = rows[c, FY] * b + rows[c, CY]
    return AGREES, u, v, rows[c, FX] * da + abs(rows[c, SKEW]) * db, rows[c, FY] * db


@kernel
def _look_at_block(rows, kinds, bounds, frames, sums, c, middle, half):
    """Says what a camera makes of all points of a box: OBJECTS, AGREES, BLIND, or UNCLEAR where they may differ."""
    seen, u, v, du, dv = _image_box(rows, kinds, bounds, c, middle, half)
    if seen != AGREES:
        return seen
    left, right = u - du + (0.5 - _PAD_PX), u + du + (0.5 + _PAD_PX)
    top, bottom = v - dv + (0.5 - _PAD_PX), v + dv + (0.5 + _PAD_PX)
    width, height = frames[c, WIDTH], frames[c, HEIGHT]
    if right < 0.0 or bottom < 0.0 or left >= width or top >= height:
        return BLIND
    if left < 0.0 or top < 0.0 or right >= width or bottom >= height:
        return UNCLEAR
    first_column, last_column = int(left) - frames[c, LEFT], int(right) + 1 - frames[c, LEFT]
    first_line, last_line = int(top) - frames[c, UPPER], int(bottom) + 1 - frames[c, UPPER]
    west, east = max(0, first_column), min(frames[c, WIDE], last_column)
    north, south = max(0, first_line), min(frames[c, HIGH], last_line)
    if west >= east or north >= south:
        return OBJECTS
    wide = frames[c, WIDE] + 1
    upper, lower = frames[c, SUMS] + north * wide, frames[c, SUMS] + south * wide
    inside = (sums[lower + east] - sums[lower + west]) - (sums[upper + east] - sums[upper + west])
    if inside == 0:
        return OBJECTS
    if inside == (last_column - first_column) * (last_line - first_line):
        return AGREES
    return UNCLEAR


@kernel
def _leaf_points(axes, block, points):
    """Fills points (3, LEAF^3) with the centres of a leaf's voxels, z running fastest."""
    xs, ys, zs = axes
    i0, j0, k0 = block
    for i in range(LEAF):
        for j in range(LEAF):
            for k in range(LEAF):
                n = (i * LEAF + j) * LEAF + k
                points[0, n], points[1, n], points[2, n] = xs[i0 + i], ys[j0 + j], zs[k0 + k]


@kernel
def _pinhole_places(rows, frames, c, points, places):
    """Finds the pixels of a leaf's voxels: places (LEAF^3,) uint32 in `pixels`, where 0 holds OBJECTS and 2 holds BLIND."""
    u_x, u_y, u_z, u_1 = rows[c, 0], rows[c, 1], rows[c, 2], rows[c, 3]
    v_x, v_y, v_z, v_1 = rows[c, 4], rows[c, 5], rows[c, 6], rows[c, 7]
    w_x, w_y, w_z, w_1 = rows[c, 8], rows[c, 9], rows[c, 10], rows[c, 11]
    width, height = float(frames[c, WIDTH]), float(frames[c, HEIGHT])
    left, upper, wide, high = np.int32(frames[c, LEFT]), np.int32(frames[c, UPPER]), np.int32(frames[c, WIDE]), np.int32(frames[c, HIGH])
    first = np.int32(frames[c, PIXELS])
    # Without a branch, so that it is done for several voxels at once.
    for n in range(_LEAF_VOXELS):
        x, y, z = points[0, n], points[1, n], points[2, n]
        w = ((w_x * x + w_y * y) + w_1) + w_z * z
        inverse = 1.0 / w
        u = (((u_x * x + u_y * y) + u_1) + u_z * z) * inverse + 0.5
        v = (((v_x * x + v_y * y) + v_1) + v_z * z) * inverse + 0.5
        sees = (w > 0.0) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height)
        # Inside the image these are not negative, so that truncation rounds down: the nearest pixel centre, ties upward.
        u, v = u if sees else 0.0, v if sees else 0.0
        column, line = np.int32(u) - left, np.int32(v) - upper
        known = (column >= 0) & (line >= 0) & (column < wide) & (line < high)
        place = first + line * wide + column if known else np.int32(0)
        places[n] = place if sees else np.int32(2)


@kernel
def _lens_places(rows, kinds, frames, c, points, places):
    """Does what `_pinhole_places` does for a camera with a lens."""
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
        if u * u + v * v > rows[c, FIELD_SQUARED]:
            continue
        a, b = bend(rows, c, kinds[c], u, v)
        u, v = (rows[c, FX] * a + rows[c, SKEW] * b) + rows[c, CX] + 0.5, rows[c, FY] * b + rows[c, CY] + 0.5
        if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
            continue
        column, line = int(u) - frames[c, LEFT], int(v) - frames[c, UPPER]
        known = column >= 0 and line >= 0 and column < frames[c, WIDE] and line < frames[c, HIGH]
        places[n] = frames[c, PIXELS] + line * frames[c, WIDE] + column if known else 0


@kernel
def _carve_leaf(rows, kinds, frames, pixels, rule, axes, state, block, occupancy, places, votes, points):
    """Decides a leaf voxel by voxel."""
    tolerance, least, outside = rule
    cameras, agreeing, objecting = state
    i0, j0, k0 = block
    _leaf_points(axes, block, points)
    votes[:] = 0
    asked = 0
    for camera in range(len(kinds)):
        if not (cameras >> camera) & 1:
            continue
        asked += 1
        if kinds[camera] == PINHOLE:
            _pinhole_places(rows, frames, camera, points, places)
        else:
            _lens_places(rows, kinds, frames, camera, points, places)
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
                occupancy[i0 + i, j0 + j, k0 + k] = (agree >= enough_agree) & (unopposed >= enough_unopposed)


@kernel
def _decide(rows, kinds, bounds, frames, sums, rule, axes, state, block, ends):
    """Asks the cameras that have yet to speak of a block; returns what they say, and what is known now."""
    tolerance, least, outside = rule
    xs, ys, zs = axes
    (i0, j0, k0), (i1, j1, k1) = block, ends
    middle = (0.5 * (xs[i0] + xs[i1 - 1]), 0.5 * (ys[j0] + ys[j1 - 1]), 0.5 * (zs[k0] + zs[k1 - 1]))
    half = (0.5 * (xs[i1 - 1] - xs[i0]), 0.5 * (ys[j1 - 1] - ys[j0]), 0.5 * (zs[k1 - 1] - zs[k0]))
    cameras, agreeing, objecting = state
    asked = cameras
    unclear = 0
    for camera in range(len(kinds)):
        if not (asked >> camera) & 1:
            continue
        verdict = _look_at_block(rows, kinds, bounds, frames, sums, camera, middle, half)
        if verdict == BLIND:
            verdict = outside
        if verdict == UNCLEAR:
            unclear += 1
        else:
            cameras ^= np.int64(1) << camera
            agreeing += verdict == AGREES
            objecting += verdict == OBJECTS
            if objecting > tolerance:
                break
    state = (cameras, agreeing, objecting)
    if objecting > tolerance or agreeing + unclear < least:
        return _EMPTY, state
    if objecting + unclear <= tolerance and agreeing >= least:
        return _FULL, state
    return _MIXED, state


@kernel
def _carve_top(rows, kinds, bounds, frames, sums, pixels, rule, axes, occupancy, top, stack, places, votes, points):
    """Takes one of the largest blocks apart, as far as it is mixed. `stack` (_DEEPEST, 7) int64 is scratch: block, size, state."""
    nx, ny, nz = occupancy.shape
    stack[0] = top
    waiting = 1
    while waiting:
        waiting -= 1
        i0, j0, k0, size = stack[waiting, 0], stack[waiting, 1], stack[waiting, 2], stack[waiting, 3]
        i1, j1, k1 = min(i0 + size, nx), min(j0 + size, ny), min(k0 + size, nz)
        state = (stack[waiting, 4], stack[waiting, 5], stack[waiting, 6])
        found, state = _decide(rows, kinds, bounds, frames, sums, rule, axes, state, (i0, j0, k0), (i1, j1, k1))
        if found == _FULL:
            for i in range(i0, i1):
                for j in range(j0, j1):
                    for k in range(k0, k1):
                        occupancy[i, j, k] = True
        elif found == _MIXED and size == LEAF:
            _carve_leaf(rows, kinds, frames, pixels, rule, axes, state, (i0, j0, k0), occupancy, places, votes, points)
        elif found == _MIXED:
            half = size // 2
            for i in range(i0, i1, half):
                for j in range(j0, j1, half):
                    for k in range(k0, k1, half):
                        child = stack[waiting]
                        child[0], child[1], child[2], child[3] = i, j, k, half
                        child[4], child[5], child[6] = state
                        waiting += 1


@parallel_kernel
def carve_blocks(rows, kinds, bounds, frames, sums, pixels, rule, axes, occupancy):
    """Carves.

    Args:
        rows: (C, COLUMNS) float64, cameras.
        kinds: (C,) int64, PINHOLE, RATIONAL or FISHEYE.
        bounds: (C, 2, bins) float64, how much a lens stretches, and how far it is from no lens, up to a radius.
        frames: (C, 8) int64, images and the boxes of their foreground.
        sums: (S,) int32, summed-area tables of all boxes, (HIGH + 1) * (WIDE + 1) each.
        pixels: (P,) uint8, OBJECTS or AGREES; the first three are OBJECTS, AGREES and BLIND, then come all boxes.
        rule: most cameras that may object, least that must agree, what a camera says that does not see.
        axes: centres of the voxels along x, y and z, float64, m, continued to a multiple of LEAF.
        occupancy: (nx, ny, nz) bool, all False, written: each block its own voxels.
    """
    ny, nz = (occupancy.shape[1] + TOP - 1) // TOP, (occupancy.shape[2] + TOP - 1) // TOP
    count = (occupancy.shape[0] + TOP - 1) // TOP * ny * nz
    for chunk in prange(_CHUNKS):
        stack = np.empty((_DEEPEST, 7), np.int64)
        places, votes = np.empty(_LEAF_VOXELS, np.uint32), np.empty(_LEAF_VOXELS, np.int32)
        points = np.empty((3, _LEAF_VOXELS))
        # Neighbours cost alike: they are dealt out over the chunks.
        for n in range(chunk, count, _CHUNKS):
            block = (n // (ny * nz) * TOP, n // nz % ny * TOP, n % nz * TOP)
            top = (block[0], block[1], block[2], TOP, (np.int64(1) << len(rows)) - 1, 0, 0)
            _carve_top(rows, kinds, bounds, frames, sums, pixels, rule, axes, occupancy, top, stack, places, votes, points)


@kernel
def foreground_box(mask):
    """Returns left, top, width and height of the box around all non-zero pixels of (h, w) uint8; zeros where there are none."""
    height, width = mask.shape
    columns = np.zeros(width, np.uint8)
    top, bottom = -1, -1
    for y in range(height):
        line = mask[y]
        found = np.uint8(0)
        for x in range(width):
            found |= line[x]
        if found:
            for x in range(width):
                columns[x] |= line[x]
            top = y if top < 0 else top
            bottom = y
    if top < 0:
        return 0, 0, 0, 0
    left, right = 0, width - 1
    while not columns[left]:
        left += 1
    while not columns[right]:
        right -= 1
    return left, top, right + 1 - left, bottom + 1 - top
