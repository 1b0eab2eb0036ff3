"""Intersection of beams with a raster, and the model of the receiver: loops only, no checks."""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel

_EDGE_TOLERANCE = 1e-12  # [m] a beam this far below the edge of a cell still enters it from above
_HEIGHT_MARGIN = 1e-9  # [m] along a ray, before the height of the highest node: far above round-off


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
    """Origin and direction of every beam at its own time, and the forward axis of the scanner.

    Parameters
    ----------
    time : (n,) true time of the first beam of each scan [s]
    knot_start, knot_step : time of the first knot, time between knots [s]
    coefficients : (pieces, 6, 6) polynomials of the pose between knots, by power and component
    lever : (3,) position of the scanner in the body [m]
    mounting : (3, 3) rotation from the scanner to the body
    angle : (beams,) angle of each beam from straight down, left positive [rad]
    delay : (beams,) time of each beam after the first one [s]
    origin : (n, beams, 3) written: positions of the scanner in the ground frame [m]
    direction : (n, beams, 3) written: unit vectors of the beams in the ground frame
    forward : (n, beams, 3) written: unit vectors of the scanner's x axis in the ground frame
    """
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
            # direction in the body frame: R_bs (0, sin angle, -cos angle)
            ca, sa = cosines[b], sines[b]
            bx = mounting[0, 1] * sa - mounting[0, 2] * ca
            by = mounting[1, 1] * sa - mounting[1, 2] * ca
            bz = mounting[2, 1] * sa - mounting[2, 2] * ca
            # body to ground frame, R_gb = Rz(yaw) Ry(pitch) Rx(roll), written out
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
    max_distance,
    spacing,
    first,
    index,
    height,
    block_top,
    tile_top,
    cells,
    block,
):
    """First intersection of one ray with the raster: distance, gradient of the ground, tile.

    The distance is NaN without an intersection, and -1 if the ray enters a missing tile. The ray is
    traversed by tiles, blocks and cells (Amanatides and Woo 1987); in each the traversal starts
    where the ray descends to the height of the highest node, since it cannot meet ground above.

    Parameters
    ----------
    ox, oy, oz : origin of the ray [m]
    dx, dy, dz : direction; a unit vector, or nearly one
    max_distance : length of the ray [m]
    spacing : distance of the nodes [m]
    first : (2,) column and row of the first tile of `index`
    index : (rows, columns) slot of each tile, -1 if it is missing
    height : (slots, cells + 1, cells + 1) heights of the nodes [m]
    block_top : (slots, blocks, blocks) height of the highest node of each block [m]
    tile_top : (slots,) height of the highest node of each tile [m]
    cells : cells along a tile
    block : cells along a block

    Returns
    -------
    distance [m], dz/dx and dz/dy [m/m], column and row of the tile
    """
    tile_size, block_size, per_spacing = cells * spacing, block * spacing, 1.0 / spacing
    blocks = cells // block
    rows, columns = index.shape
    per_x = 1.0 / dx if dx != 0.0 else math.inf
    per_y = 1.0 / dy if dy != 0.0 else math.inf
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    border_x, border_y = (1 if dx > 0.0 else 0), (1 if dy > 0.0 else 0)
    tile_x, tile_y = int(math.floor(ox / tile_size)), int(math.floor(oy / tile_size))
    tile_start = 0.0
    while tile_start < max_distance:
        # distance at which the ray leaves this tile
        tile_exit_x = ((tile_x + border_x) * tile_size - ox) * per_x if dx != 0.0 else math.inf
        tile_exit_y = ((tile_y + border_y) * tile_size - oy) * per_y if dy != 0.0 else math.inf
        tile_end = min(tile_exit_x, tile_exit_y, max_distance)
        column, row = tile_x - first[0], tile_y - first[1]
        inside = 0 <= column < columns and 0 <= row < rows
        slot = index[row, column] if inside else -1
        if slot < 0:
            return -1.0, math.nan, math.nan, tile_x, tile_y
        block_start = tile_start
        if dz < 0.0:
            block_start = max(tile_start, (tile_top[slot] - oz) / dz - _HEIGHT_MARGIN)
        elif oz + dz * tile_start > tile_top[slot]:
            block_start = math.inf
        if block_start < tile_end:
            # traverse the blocks of the tile
            left, bottom = tile_x * blocks, tile_y * blocks
            bx = int(math.floor((ox + dx * block_start) / block_size))
            by = int(math.floor((oy + dy * block_start) / block_size))
            bx = min(max(bx, left), left + blocks - 1)
            by = min(max(by, bottom), bottom + blocks - 1)
            while True:
                block_exit_x = (
                    ((bx + border_x) * block_size - ox) * per_x if dx != 0.0 else math.inf
                )
                block_exit_y = (
                    ((by + border_y) * block_size - oy) * per_y if dy != 0.0 else math.inf
                )
                block_end = min(block_exit_x, block_exit_y, tile_end)
                top = block_top[slot, by - bottom, bx - left]
                cell_start = block_start
                if dz < 0.0:
                    cell_start = max(block_start, (top - oz) / dz - _HEIGHT_MARGIN)
                elif oz + dz * block_start > top:
                    cell_start = math.inf
                if cell_start <= block_end:
                    # traverse the cells of the block
                    low_x, low_y = bx * block, by * block
                    cx = int(math.floor((ox + dx * cell_start) / spacing))
                    cy = int(math.floor((oy + dy * cell_start) / spacing))
                    cx = min(max(cx, low_x), low_x + block - 1)
                    cy = min(max(cy, low_y), low_y + block - 1)
                    while True:
                        cell_exit_x = (
                            ((cx + border_x) * spacing - ox) * per_x if dx != 0.0 else math.inf
                        )
                        cell_exit_y = (
                            ((cy + border_y) * spacing - oy) * per_y if dy != 0.0 else math.inf
                        )
                        cell_end = min(cell_exit_x, cell_exit_y, block_end)
                        i, j = cx - tile_x * cells, cy - tile_y * cells
                        h00, h10 = height[slot, j, i], height[slot, j, i + 1]
                        h01, h11 = height[slot, j + 1, i], height[slot, j + 1, i + 1]
                        lowest = oz + min(dz * cell_start, dz * cell_end)
                        if lowest <= max(max(h00, h10), max(h01, h11)):
                            # The height of the ray above the bilinear ground is a quadratic of
                            # the distance t within the cell: a + b t + c t^2.
                            fx = (ox + dx * cell_start) * per_spacing - cx
                            fy = (oy + dy * cell_start) * per_spacing - cy
                            gx, gy = dx * per_spacing, dy * per_spacing
                            ex, ey = h10 - h00, h01 - h00
                            twist = h11 - h10 - h01 + h00
                            a = oz + dz * cell_start - (h00 + ex * fx + ey * fy + twist * fx * fy)
                            b = dz - (ex * gx + ey * gy + twist * (fx * gy + fy * gx))
                            c = -twist * gx * gy
                            t = math.inf
                            if a <= 0.0:
                                # at the ground on entry; a ray that starts below it has no hit
                                t = 0.0 if a >= -_EDGE_TOLERANCE or cell_start > 0.0 else math.inf
                            elif c == 0.0:
                                if b < 0.0:
                                    t = -a / b
                            else:
                                root = b * b - 4.0 * a * c
                                if root >= 0.0:
                                    # both roots without cancellation (Press 2007, 5.6)
                                    q = -0.5 * (b + math.copysign(math.sqrt(root), b))
                                    t1 = q / c
                                    t2 = a / q if q != 0.0 else math.inf
                                    t1 = t1 if t1 >= 0.0 else math.inf
                                    t2 = t2 if t2 >= 0.0 else math.inf
                                    t = min(t1, t2)
                            if t <= cell_end - cell_start:
                                fx += gx * t
                                fy += gy * t
                                slope_x = (ex + twist * fy) * per_spacing
                                slope_y = (ey + twist * fx) * per_spacing
                                return cell_start + t, slope_x, slope_y, tile_x, tile_y
                        if cell_end >= block_end:
                            break
                        cell_start = cell_end
                        if cell_exit_x <= cell_exit_y:
                            cx += step_x
                        else:
                            cy += step_y
                        if not (low_x <= cx < low_x + block and low_y <= cy < low_y + block):
                            break
                if block_end >= tile_end:
                    break
                block_start = block_end
                if block_exit_x <= block_exit_y:
                    bx += step_x
                else:
                    by += step_y
                if not (left <= bx < left + blocks and bottom <= by < bottom + blocks):
                    break
        tile_start = tile_end
        if tile_exit_x <= tile_exit_y:
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
    max_distance,
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

    Parameters
    ----------
    origin, direction, forward : (n, 3) of each beam: origin [m], unit direction, unit vector along
        which the spot extends
    spot : (rays, 2) rotation of each ray along `forward` and at right angles to it [rad]; the
        central ray is the beam
    max_distance, spacing, first, index, height, block_top, tile_top, cells, block : as in
        `_first_intersection`
    distance : (n,) written: mean distance of the rays [m]; NaN if the central ray has no
        intersection, -1 if a ray enters a missing tile
    slope : (n, 2) written: gradient of the ground at the end of the central ray [m/m]
    missing : (n, 2) written: column and row of the missing tile
    """
    rays = spot.shape[0]
    for n in prange(origin.shape[0]):
        ox, oy, oz = origin[n, 0], origin[n, 1], origin[n, 2]
        mx, my, mz = direction[n, 0], direction[n, 1], direction[n, 2]
        fx, fy, fz = forward[n, 0], forward[n, 1], forward[n, 2]
        sx, sy, sz = fy * mz - fz * my, fz * mx - fx * mz, fx * my - fy * mx
        total, hits, central = 0.0, 0, math.nan
        for r in range(rays):
            longitudinal, lateral = spot[r, 0], spot[r, 1]
            hit_distance, slope_x, slope_y, tile_x, tile_y = _first_intersection(
                ox,
                oy,
                oz,
                mx + longitudinal * fx + lateral * sx,
                my + longitudinal * fy + lateral * sy,
                mz + longitudinal * fz + lateral * sz,
                max_distance,
                spacing,
                first,
                index,
                height,
                block_top,
                tile_top,
                cells,
                block,
            )
            if hit_distance == -1.0:
                central, total, hits = -1.0, -1.0, 1
                missing[n, 0], missing[n, 1] = tile_x, tile_y
                break
            if r == rays // 2:
                central = hit_distance
                slope[n, 0], slope[n, 1] = slope_x, slope_y
            if not math.isnan(hit_distance):
                total += hit_distance
                hits += 1
        distance[n] = math.nan if math.isnan(central) else total / hits


@compile_kernel(parallel=True)
def receive_beams(
    true_range,
    direction,
    slope,
    reflectivity,
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
    """Recorded range, its errors, and intensity of each beam.

    Parameters
    ----------
    true_range : (n,) exact distance [m]; NaN without a return
    direction : (n, 3) unit vectors
    slope : (n, 2) gradient of the ground [m/m]
    reflectivity : (1,) or (n,) reflectivity of the ground
    speckle, noise : (n,) standard normal numbers of intensity and range
    loss : (n,) uniform numbers from 0 to 1
    nominal : range at which `gain` holds [m]
    gain, intensity_noise, floor, saturation : signal at normal incidence on reflectivity 1, sd,
        weakest signal that is detected, strongest that is measured [counts]
    saturation_bias : range error per relative excess of the signal over saturation [m]
    range_noise : sd [m]
    quantum : step of the ranges [m]; 0 for none
    dropouts : fraction of returns lost at random
    ranges : (n,) written: recorded range [m]
    counts : (n,) written: recorded intensity [counts]
    bias : (n,) written: error by saturation [m]
    """
    for n in prange(true_range.size):
        signal = 0.0
        if not math.isnan(true_range[n]):
            gx, gy = slope[n, 0], slope[n, 1]
            # Lambert's cosine law and the inverse square of the range
            incidence = gx * direction[n, 0] + gy * direction[n, 1] - direction[n, 2]
            cosine = max(incidence / math.sqrt(1.0 + gx * gx + gy * gy), 0.0)
            signal = (
                gain * reflectivity[n % reflectivity.size] * cosine * (nominal / true_range[n]) ** 2
            )
        signal += intensity_noise * speckle[n]
        bias[n] = saturation_bias * max(signal / saturation - 1.0, 0.0)
        value = true_range[n] + bias[n] + range_noise * noise[n]
        if quantum > 0.0:
            value = np.rint(value / quantum) * quantum
        ranges[n] = np.nan if loss[n] < dropouts or signal < floor else value
        counts[n] = np.uint16(min(max(np.rint(min(signal, saturation)), 0.0), 65535.0))
