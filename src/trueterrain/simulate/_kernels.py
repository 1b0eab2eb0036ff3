"""Casting beams on a raster. No checks: the callers make them."""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel

_BELOW = 1e-12  # [m] a beam this little below a cell's edge enters it from above all the same
_ABOVE = 1e-9  # [m] along a ray, before it comes as low as the highest node: far above round-off


@compile_kernel(parallel=True)
def beam_rays(
    time,
    knot_start,
    knot_step,
    coefficients,
    lever,
    mounting,
    angle,
    delay,
    origin,
    direction,
    forward,
):
    """Origin and direction of every beam, each at its own time, and the scanner's forward axis."""
    last = coefficients.shape[0] - 1
    sines, cosines = np.sin(angle), np.cos(angle)
    for n in prange(time.size):
        pose = np.empty(6)
        for b in range(angle.size):
            x = (time[n] + delay[b] - knot_start) / knot_step
            piece = min(max(int(x), 0), last)
            x -= piece
            for c in range(6):
                k = coefficients[piece, :, c]
                pose[c] = ((((k[5] * x + k[4]) * x + k[3]) * x + k[2]) * x + k[1]) * x + k[0]
            cr, sr = math.cos(pose[3]), math.sin(pose[3])
            cp, sp = math.cos(pose[4]), math.sin(pose[4])
            cy, sy = math.cos(pose[5]), math.sin(pose[5])
            # the beam in the body: the mounting turns (0, sin angle, -cos angle)
            ca, sa = cosines[b], sines[b]
            bx = mounting[0, 1] * sa - mounting[0, 2] * ca
            by = mounting[1, 1] * sa - mounting[1, 2] * ca
            bz = mounting[2, 1] * sa - mounting[2, 2] * ca
            # body -> ground: turn about x by roll, then y by pitch, then z by yaw
            for v in range(3):
                if v == 0:
                    px, py, pz = bx, by, bz
                elif v == 1:
                    px, py, pz = lever[0], lever[1], lever[2]
                else:
                    px, py, pz = mounting[0, 0], mounting[1, 0], mounting[2, 0]
                ry, rz = cr * py - sr * pz, sr * py + cr * pz
                qx, qz = cp * px + sp * rz, -sp * px + cp * rz
                gx, gy = cy * qx - sy * ry, sy * qx + cy * ry
                if v == 0:
                    direction[n, b, 0], direction[n, b, 1], direction[n, b, 2] = gx, gy, qz
                elif v == 1:
                    origin[n, b, 0] = pose[0] + gx
                    origin[n, b, 1] = pose[1] + gy
                    origin[n, b, 2] = pose[2] + qz
                else:
                    forward[n, b, 0], forward[n, b, 1], forward[n, b, 2] = gx, gy, qz


@compile_kernel
def _first_intersection(
    ox,
    oy,
    oz,
    dx,
    dy,
    dz,
    furthest,
    spacing,
    first,
    index,
    height,
    block_top,
    tile_top,
    cells,
    block,
):
    """Distance at which one ray meets the raster, gradient there, and the tile that it is in.

    The distance is NaN if it meets nothing, and -1 in a tile that is not there. A ray is followed
    from tile to tile, from block to block and from cell to cell, but in each it begins only where
    it comes below the highest node.
    """
    tile_size, block_size, per_metre = cells * spacing, block * spacing, 1.0 / spacing
    blocks = cells // block
    rows, columns = index.shape
    per_x = 1.0 / dx if dx != 0.0 else math.inf
    per_y = 1.0 / dy if dy != 0.0 else math.inf
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    ahead_x, ahead_y = (1 if dx > 0.0 else 0), (1 if dy > 0.0 else 0)
    tile_x, tile_y = int(math.floor(ox / tile_size)), int(math.floor(oy / tile_size))
    rho = 0.0
    while rho < furthest:
        # where the ray leaves this tile
        tile_out_x = ((tile_x + ahead_x) * tile_size - ox) * per_x if dx != 0.0 else math.inf
        tile_out_y = ((tile_y + ahead_y) * tile_size - oy) * per_y if dy != 0.0 else math.inf
        tile_end = min(tile_out_x, tile_out_y, furthest)
        column, row = tile_x - first[0], tile_y - first[1]
        inside = 0 <= column < columns and 0 <= row < rows
        slot = index[row, column] if inside else -1
        if slot < 0:
            return -1.0, math.nan, math.nan, tile_x, tile_y
        at = rho
        if dz < 0.0:
            at = max(rho, (tile_top[slot] - oz) / dz - _ABOVE)
        elif oz + dz * rho > tile_top[slot]:
            at = math.inf
        if at < tile_end:
            # through the blocks of the tile
            left, bottom = tile_x * blocks, tile_y * blocks
            bx = int(math.floor((ox + dx * at) / block_size))
            by = int(math.floor((oy + dy * at) / block_size))
            bx = min(max(bx, left), left + blocks - 1)
            by = min(max(by, bottom), bottom + blocks - 1)
            while True:
                out_x = ((bx + ahead_x) * block_size - ox) * per_x if dx != 0.0 else math.inf
                out_y = ((by + ahead_y) * block_size - oy) * per_y if dy != 0.0 else math.inf
                block_end = min(out_x, out_y, tile_end)
                top = block_top[slot, by - bottom, bx - left]
                here = at
                if dz < 0.0:
                    here = max(at, (top - oz) / dz - _ABOVE)
                elif oz + dz * at > top:
                    here = math.inf
                if here <= block_end:
                    # through the cells of the block
                    low_x, low_y = bx * block, by * block
                    cx = int(math.floor((ox + dx * here) / spacing))
                    cy = int(math.floor((oy + dy * here) / spacing))
                    cx = min(max(cx, low_x), low_x + block - 1)
                    cy = min(max(cy, low_y), low_y + block - 1)
                    while True:
                        leave_x = ((cx + ahead_x) * spacing - ox) * per_x if dx != 0.0 else math.inf
                        leave_y = ((cy + ahead_y) * spacing - oy) * per_y if dy != 0.0 else math.inf
                        cell_end = min(leave_x, leave_y, block_end)
                        i, j = cx - tile_x * cells, cy - tile_y * cells
                        h00, h10 = height[slot, j, i], height[slot, j, i + 1]
                        h01, h11 = height[slot, j + 1, i], height[slot, j + 1, i + 1]
                        lowest = oz + min(dz * here, dz * cell_end)
                        if lowest <= max(max(h00, h10), max(h01, h11)):
                            # ray above ground is a quadratic of the way t through the cell
                            fx = (ox + dx * here) * per_metre - cx
                            fy = (oy + dy * here) * per_metre - cy
                            gx, gy = dx * per_metre, dy * per_metre
                            ex, ey = h10 - h00, h01 - h00
                            twist = h11 - h10 - h01 + h00
                            a = oz + dz * here - (h00 + ex * fx + ey * fy + twist * fx * fy)
                            b = dz - (ex * gx + ey * gy + twist * (fx * gy + fy * gx))
                            c = -twist * gx * gy
                            t = math.inf
                            if a <= 0.0:
                                # met on the edge; a ray that starts below meets nothing
                                t = 0.0 if a >= -_BELOW or here > 0.0 else math.inf
                            elif c == 0.0:
                                if b < 0.0:
                                    t = -a / b
                            else:
                                root = b * b - 4.0 * a * c
                                if root >= 0.0:
                                    q = -0.5 * (b + math.copysign(math.sqrt(root), b))
                                    t1 = q / c
                                    t2 = a / q if q != 0.0 else math.inf
                                    t1 = t1 if t1 >= 0.0 else math.inf
                                    t2 = t2 if t2 >= 0.0 else math.inf
                                    t = min(t1, t2)
                            if t <= cell_end - here:
                                fx += gx * t
                                fy += gy * t
                                slope_x = (ex + twist * fy) * per_metre
                                slope_y = (ey + twist * fx) * per_metre
                                return here + t, slope_x, slope_y, tile_x, tile_y
                        if cell_end >= block_end:
                            break
                        here = cell_end
                        if leave_x <= leave_y:
                            cx += step_x
                        else:
                            cy += step_y
                        if not (low_x <= cx < low_x + block and low_y <= cy < low_y + block):
                            break
                if block_end >= tile_end:
                    break
                at = block_end
                if out_x <= out_y:
                    bx += step_x
                else:
                    by += step_y
                if not (left <= bx < left + blocks and bottom <= by < bottom + blocks):
                    break
        rho = tile_end
        if tile_out_x <= tile_out_y:
            tile_x += step_x
        else:
            tile_y += step_y
    return math.nan, math.nan, math.nan, tile_x, tile_y


@compile_kernel(parallel=True)
def cast_rays(
    origin,
    direction,
    forward,
    spot,
    furthest,
    spacing,
    first,
    index,
    height,
    block_top,
    tile_top,
    cells,
    block,
    distance,
    slope,
    missing,
):
    """First intersection of each beam with the raster, averaged over the rays of its spot.

    A ray is turned by ``spot[r, 0]`` along `forward` and by ``spot[r, 1]`` beside it. `distance`
    is NaN where the middle ray meets nothing within `furthest`; `slope` holds the gradient of the
    ground where that one ends. A beam of which a ray enters a tile which is not there gets its
    column and row in `missing` (and a distance of -1).
    """
    rays = spot.shape[0]
    for n in prange(origin.shape[0]):
        ox, oy, oz = origin[n, 0], origin[n, 1], origin[n, 2]
        mx, my, mz = direction[n, 0], direction[n, 1], direction[n, 2]
        fx, fy, fz = forward[n, 0], forward[n, 1], forward[n, 2]
        sx, sy, sz = fy * mz - fz * my, fz * mx - fx * mz, fx * my - fy * mx
        total, met, middle = 0.0, 0, math.nan
        for r in range(rays):
            along, beside = spot[r, 0], spot[r, 1]
            reached, slope_x, slope_y, tile_x, tile_y = _first_intersection(
                ox,
                oy,
                oz,
                mx + along * fx + beside * sx,
                my + along * fy + beside * sy,
                mz + along * fz + beside * sz,
                furthest,
                spacing,
                first,
                index,
                height,
                block_top,
                tile_top,
                cells,
                block,
            )
            if reached == -1.0:
                middle, total, met = -1.0, -1.0, 1
                missing[n, 0], missing[n, 1] = tile_x, tile_y
                break
            if r == rays // 2:
                middle = reached
                slope[n, 0], slope[n, 1] = slope_x, slope_y
            if not math.isnan(reached):
                total += reached
                met += 1
        distance[n] = math.nan if math.isnan(middle) else total / met


@compile_kernel(parallel=True)
def receive_beams(
    true_range,
    direction,
    slope,
    bright,
    speckle,
    noise,
    loss,
    nominal,
    gain,
    intensity_noise,
    floor,
    saturation,
    saturation_bias,
    range_noise,
    quantum,
    dropouts,
    ranges,
    counts,
    bias,
):
    """What the receiver makes of each beam: range with its errors, and intensity."""
    for n in prange(true_range.size):
        signal = 0.0
        if not math.isnan(true_range[n]):
            gx, gy = slope[n, 0], slope[n, 1]
            facing = gx * direction[n, 0] + gy * direction[n, 1] - direction[n, 2]
            cosine = max(facing / math.sqrt(1.0 + gx * gx + gy * gy), 0.0)
            signal = gain * bright[n % bright.size] * cosine * (nominal / true_range[n]) ** 2
        signal += intensity_noise * speckle[n]
        bias[n] = saturation_bias * max(signal / saturation - 1.0, 0.0)
        value = true_range[n] + bias[n] + range_noise * noise[n]
        if quantum > 0.0:
            value = np.rint(value / quantum) * quantum
        ranges[n] = np.nan if loss[n] < dropouts or signal < floor else value
        counts[n] = np.uint16(min(max(np.rint(min(signal, saturation)), 0.0), 65535.0))
