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

# What all cameras say of a block.
_EMPTY, _FULL, _MIXED = 0, 1, 2

_NEAR_M = 1e-3  # a block must be in front of the camera by this for its image to be bounded
_PAD_PX = 1e-3  # rounding of the block's image, many times over
_DEPTH_ERROR_M = 1e-9


@kernel
def bend(camera, kind, x, y):
    """Distorts ideal coordinates; the operations and their order are those of `reference.bend`."""
    s = x * x + y * y
    if kind == FISHEYE:
        radius = math.sqrt(s)
        if radius < 1e-8:
            return x, y
        angle = math.atan(radius)
        t = angle * angle
        ratio = angle * (1.0 + t * (camera[K1] + t * (camera[K2] + t * (camera[K3] + t * camera[K4])))) / radius
        return x * ratio, y * ratio
    below = 1.0 + s * (camera[K4] + s * (camera[K5] + s * camera[K6]))
    ratio = (1.0 + s * (camera[K1] + s * (camera[K2] + s * camera[K3]))) / below
    xy = 2.0 * x * y
    a = x * ratio + (camera[P1] * xy + camera[P2] * (s + 2.0 * x * x)) + s * (camera[S1] + s * camera[S2])
    b = y * ratio + (camera[P1] * (s + 2.0 * y * y) + camera[P2] * xy) + s * (camera[S3] + s * camera[S4])
    if camera[TILT] != 0.0:
        u = (camera[TILT] * a + camera[TILT + 1] * b) + camera[TILT + 2]
        v = (camera[TILT + 3] * a + camera[TILT + 4] * b) + camera[TILT + 5]
        w = (camera[TILT + 6] * a + camera[TILT + 7] * b) + camera[TILT + 8]
        a, b = u / w, v / w
    return a, b


@kernel
def _image_box(row, kind, bound, middle, half):
    """Bounds the image of a box of points given by its middle and half its edges.

    Returns UNCLEAR or BLIND, or AGREES with the middle's pixel and how far from it, along the two axes, the image may reach.
    """
    x, y, z = middle
    w = row[8] * x + row[9] * y + row[10] * z + row[11]
    depth = abs(row[8]) * half[0] + abs(row[9]) * half[1] + abs(row[10]) * half[2]
    if w + depth < -_DEPTH_ERROR_M:
        return BLIND, 0.0, 0.0, 0.0, 0.0
    if w - depth < _NEAR_M:
        return UNCLEAR, 0.0, 0.0, 0.0, 0.0
    u = (row[0] * x + row[1] * y + row[2] * z + row[3]) / w
    v = (row[4] * x + row[5] * y + row[6] * z + row[7]) / w
    # U / W - u = (U - u W) / W: the numerator is affine and zero in the middle, the denominator is at least w - depth.
    nearest = 1.0 / (w - depth)
    du = (abs(row[0] - u * row[8]) * half[0] + abs(row[1] - u * row[9]) * half[1] + abs(row[2] - u * row[10]) * half[2]) * nearest
    dv = (abs(row[4] - v * row[8]) * half[0] + abs(row[5] - v * row[9]) * half[1] + abs(row[6] - v * row[10]) * half[2]) * nearest
    if kind == PINHOLE:
        return AGREES, u, v, du, dv
    x_near, y_near = max(0.0, abs(u) - du), max(0.0, abs(v) - dv)
    if math.sqrt(x_near * x_near + y_near * y_near) > row[SEEN_RADIUS]:
        return BLIND, 0.0, 0.0, 0.0, 0.0
    x_far, y_far = abs(u) + du, abs(v) + dv
    farthest = math.sqrt(x_far * x_far + y_far * y_far)
    if farthest >= row[REACH]:
        return UNCLEAR, 0.0, 0.0, 0.0, 0.0
    # Mean value theorem: over a disc where |J| <= steep and |J - 1| <= change, a point moves from the middle's image by no more.
    place = min(bound.shape[1] - 1, int(farthest / row[REACH] * bound.shape[1]))
    steep, change = bound[0, place], bound[1, place]
    reach = math.sqrt(du * du + dv * dv)
    a, b = bend(row, kind, u, v)
    da, db = min(du + change * reach, steep * reach), min(dv + change * reach, steep * reach)
    u = row[FX] * a + row[SKEW] * b + row[CX]
    v = row[FY] * b + row[CY]
    return AGREES, u, v, row[FX] * da + abs(row[SKEW]) * db, row[FY] * db


@kernel
def _look_at_block(row, kind, bound, frame, sums, middle, half):
    """Says what a camera makes of all points of a box: OBJECTS, AGREES, BLIND, or UNCLEAR where they may differ."""
    seen, u, v, du, dv = _image_box(row, kind, bound, middle, half)
    if seen != AGREES:
        return seen
    left, right = u - du + (0.5 - _PAD_PX), u + du + (0.5 + _PAD_PX)
    top, bottom = v - dv + (0.5 - _PAD_PX), v + dv + (0.5 + _PAD_PX)
    width, height = frame[WIDTH], frame[HEIGHT]
    if right < 0.0 or bottom < 0.0 or left >= width or top >= height:
        return BLIND
    if left < 0.0 or top < 0.0 or right >= width or bottom >= height:
        return UNCLEAR
    first_column, last_column = int(left) - frame[LEFT], int(right) + 1 - frame[LEFT]
    first_line, last_line = int(top) - frame[UPPER], int(bottom) + 1 - frame[UPPER]
    a, b = max(0, first_column), min(frame[WIDE], last_column)
    c, d = max(0, first_line), min(frame[HIGH], last_line)
    if a >= b or c >= d:
        return OBJECTS
    wide = frame[WIDE] + 1
    upper, lower = frame[SUMS] + c * wide, frame[SUMS] + d * wide
    inside = (sums[lower + b] - sums[lower + a]) - (sums[upper + b] - sums[upper + a])
    if inside == 0:
        return OBJECTS
    if inside == (last_column - first_column) * (last_line - first_line):
        return AGREES
    return UNCLEAR


@kernel
def _pinhole_places(row, frame, axes, block, places, work):
    """Finds the pixels of a leaf's voxels: places (LEAF^3,) int32 in `pixels`, where 0 holds OBJECTS and 2 holds BLIND."""
    xs, ys, zs = axes
    i0, j0, k0 = block
    us, vs, ws = work[0], work[1], work[2]
    for i in range(LEAF):
        for j in range(LEAF):
            x, y = xs[i0 + i], ys[j0 + j]
            u = (row[0] * x + row[1] * y) + row[3]
            v = (row[4] * x + row[5] * y) + row[7]
            w = (row[8] * x + row[9] * y) + row[11]
            n = (i * LEAF + j) * LEAF
            for k in range(LEAF):
                z = zs[k0 + k]
                us[n + k], vs[n + k], ws[n + k] = u + row[2] * z, v + row[6] * z, w + row[10] * z
    width, height = float(frame[WIDTH]), float(frame[HEIGHT])
    left, upper, wide, high = np.int32(frame[LEFT]), np.int32(frame[UPPER]), np.int32(frame[WIDE]), np.int32(frame[HIGH])
    first = np.int32(frame[PIXELS])
    # Without a branch, so that it is done for several voxels at once.
    for n in range(_LEAF_VOXELS):
        w = ws[n]
        inverse = 1.0 / w
        u, v = us[n] * inverse + 0.5, vs[n] * inverse + 0.5
        sees = (w > 0.0) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height)
        # Inside the image these are not negative, so that truncation rounds down: the nearest pixel centre, ties upward.
        u, v = u if sees else 0.0, v if sees else 0.0
        column, line = np.int32(u) - left, np.int32(v) - upper
        known = (column >= 0) & (line >= 0) & (column < wide) & (line < high)
        place = first + line * wide + column if known else np.int32(0)
        places[n] = place if sees else np.int32(2)


@kernel
def _lens_places(row, kind, frame, axes, block, places):
    """Does what `_pinhole_places` does for a camera with a lens."""
    xs, ys, zs = axes
    i0, j0, k0 = block
    width, height = float(frame[WIDTH]), float(frame[HEIGHT])
    for n in range(_LEAF_VOXELS):
        x, y, z = xs[i0 + n // (LEAF * LEAF)], ys[j0 + n // LEAF % LEAF], zs[k0 + n % LEAF]
        places[n] = 2
        w = ((row[8] * x + row[9] * y) + row[11]) + row[10] * z
        if not w > 0.0:
            continue
        inverse = 1.0 / w
        u = (((row[0] * x + row[1] * y) + row[3]) + row[2] * z) * inverse
        v = (((row[4] * x + row[5] * y) + row[7]) + row[6] * z) * inverse
        if u * u + v * v > row[FIELD_SQUARED]:
            continue
        a, b = bend(row, kind, u, v)
        u, v = (row[FX] * a + row[SKEW] * b) + row[CX] + 0.5, row[FY] * b + row[CY] + 0.5
        if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
            continue
        column, line = int(u) - frame[LEFT], int(v) - frame[UPPER]
        known = column >= 0 and line >= 0 and column < frame[WIDE] and line < frame[HIGH]
        places[n] = frame[PIXELS] + line * frame[WIDE] + column if known else 0


@kernel
def _next_camera(cameras, camera):
    """Returns the first camera of a set that is not before `camera`; the set must hold one."""
    while not (cameras >> camera) & 1:
        camera += 1
    return camera


@kernel
def _carve_leaf(rows, kinds, frames, pixels, rule, axes, state, block, occupancy, places, votes, work):
    """Decides a leaf voxel by voxel."""
    tolerance, least, outside = rule
    cameras, agreeing, objecting = state
    i0, j0, k0 = block
    votes[:] = 0
    asked = 0
    camera = 0
    while cameras >> camera:
        camera = _next_camera(cameras, camera)
        if kinds[camera] == PINHOLE:
            _pinhole_places(rows[camera], frames[camera], axes, block, places, work)
        else:
            _lens_places(rows[camera], kinds[camera], frames[camera], axes, block, places)
        for n in range(_LEAF_VOXELS):
            votes[n] += pixels[places[n]]
        asked += 1
        camera += 1
    for i in range(i0, min(i0 + LEAF, occupancy.shape[0])):
        for j in range(j0, min(j0 + LEAF, occupancy.shape[1])):
            for k in range(k0, min(k0 + LEAF, occupancy.shape[2])):
                vote = votes[((i - i0) * LEAF + (j - j0)) * LEAF + (k - k0)]
                agree, blind = vote % BLIND, vote // BLIND
                object_ = asked - agree - (0 if outside == OBJECTS else blind)
                occupancy[i, j, k] = objecting + object_ <= tolerance and agreeing + agree >= least


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
    camera = 0
    while asked >> camera:
        camera = _next_camera(asked, camera)
        verdict = _look_at_block(rows[camera], kinds[camera], bounds[camera], frames[camera], sums, middle, half)
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
        camera += 1
    state = (cameras, agreeing, objecting)
    if objecting > tolerance or agreeing + unclear < least:
        return _EMPTY, state
    if objecting + unclear <= tolerance and agreeing >= least:
        return _FULL, state
    return _MIXED, state


@kernel
def _carve_top(rows, kinds, bounds, frames, sums, pixels, rule, axes, occupancy, top, stack, places, votes, work):
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
            _carve_leaf(rows, kinds, frames, pixels, rule, axes, state, (i0, j0, k0), occupancy, places, votes, work)
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
        places, votes = np.empty(_LEAF_VOXELS, np.int32), np.empty(_LEAF_VOXELS, np.int32)
        work = np.empty((3, _LEAF_VOXELS))
        # Neighbours cost alike: they are dealt out over the chunks.
        for n in range(chunk, count, _CHUNKS):
            block = (n // (ny * nz) * TOP, n // nz % ny * TOP, n % nz * TOP)
            top = (block[0], block[1], block[2], TOP, (np.int64(1) << len(rows)) - 1, 0, 0)
            _carve_top(rows, kinds, bounds, frames, sums, pixels, rule, axes, occupancy, top, stack, places, votes, work)


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
