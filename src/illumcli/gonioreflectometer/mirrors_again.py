"""Light that mirror facets mirror more than once, in blocks of cells of half and difference angles."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, column_major, dot, mirror
from illumcli.gonioreflectometer.bench import Bench
from illumcli.gonioreflectometer.directions import LEAST_COSINE, half_angles, turned
from illumcli.gonioreflectometer.estimate import REPLICATES
from illumcli.gonioreflectometer.mirrors import CHUNK, Fresnel
from illumcli.measured_files.merl import SHAPE, cell_directions, coordinates

GROUP = (3, 3, 6)
"""Cells of a block along theta_h, theta_d and phi_d: what is mirrored again varies slowly."""
BLOCKS = tuple(size // group for size, group in zip(SHAPE, GROUP, strict=True))
BLOCK_COUNT = BLOCKS[0] * BLOCKS[1] * BLOCKS[2]


def mirrored_again(bench: Bench, light: tuple[Fresnel, int], draw: tuple[int, tuple[int, ...]]) -> Floats:
    """(3, BLOCK_COUNT) the mean of f_r over the blocks, without what is mirrored once [1/sr].

    Light comes from all directions above the horizon alike. With p its density over the solid angle, a ray
    that leaves towards v adds F^k / (n.v) to the block of (l, v), over p, the number of rays and the measure
    of the block, the integral of d omega_l d omega_v = 4 cos(theta_d) d omega_h d omega_d.

    Parameters
    ----------
    draw
        Samples per block over all replicates, and the key of the random numbers.
    """
    fresnel, bounces = light
    samples, key = draw
    count = samples * BLOCK_COUNT // REPLICATES
    random = np.random.default_rng(list(key))
    out = np.zeros((3, BLOCK_COUNT))
    for first in range(0, count, CHUNK):
        rays = min(CHUNK, count - first)
        l = _above_horizon(random.random((2, rays)))
        d, share, left = l, np.ones((3, rays)), np.arange(rays)
        hits = bench.first_points(d, random.random((rays, 2)))
        for bounce in range(bounces):
            arrived = np.flatnonzero(hits.is_hit)
            d, share, left, hits = d[arrived], share[:, arrived], left[arrived], hits.take(arrived)
            cosine = dot(d, hits.normal)
            share = share * fresnel(np.clip(cosine, 0, 1))
            d = mirror(d, hits.normal, cosine)
            following = bench.leaving(hits, d)
            if bounce:
                gone = np.flatnonzero(~following.is_hit & (d[:, 2] > LEAST_COSINE))
                block = block_of(l[left[gone]], d[gone])
                for channel in range(3):
                    out[channel] += np.bincount(block, share[channel, gone] / d[gone, 2], BLOCK_COUNT)
            d, hits = -d, following
    density = 1 / (2 * np.pi * (1 - LEAST_COSINE))
    measure = block_measures()
    return np.divide(out, count * density * measure, out=np.zeros_like(out), where=measure > 0)


def _above_horizon(u: Floats) -> Floats:
    """(N, 3) directions of which the solid angle above the lowest elevation is uniform, from (2, N) u."""
    z = LEAST_COSINE + (1 - LEAST_COSINE) * u[0]
    flat = np.stack([np.sqrt(1 - z * z), np.zeros_like(z), z], axis=1)
    return turned(column_major(flat), 2 * np.pi * u[1])


def block_of(l: Floats, v: Floats) -> NDArray[np.int64]:
    """(N,) the blocks of pairs of directions."""
    angles = half_angles(l, v)
    parts = [
        np.clip((each // group).astype(np.int64), 0, count - 1)
        for each, group, count in zip(coordinates(*angles), GROUP, BLOCKS, strict=True)
    ]
    return (parts[0] * BLOCKS[1] + parts[1]) * BLOCKS[2] + parts[2]


@cache
def block_measures() -> Floats:
    """(BLOCK_COUNT,) the measure of the pairs of directions of each block that are high enough."""
    theta_h = np.cos((np.arange(SHAPE[0] + 1) / SHAPE[0]) ** 2 * (np.pi / 2))
    theta_d = np.sin(np.arange(SHAPE[1] + 1) / SHAPE[1] * (np.pi / 2)) ** 2
    out = np.zeros(BLOCKS)
    for row in range(SHAPE[0]):
        l, v = (d[:, 2].reshape(SHAPE[1:]) for d in cell_directions(row))
        is_high = (l > LEAST_COSINE) & (v > LEAST_COSINE)
        # 4 cos sin d theta_d is 2 d sin^2; both halves of phi_d, all turns of h
        each = 2 * np.diff(theta_d)[:, None] * (2 * np.pi / SHAPE[2]) * is_high
        grouped = each.reshape(BLOCKS[1], GROUP[1], BLOCKS[2], GROUP[2]).sum(axis=(1, 3))
        out[row // GROUP[0]] += 2 * np.pi * (theta_h[row] - theta_h[row + 1]) * grouped
    return out.ravel()


def of_cells(blocks: Floats) -> Floats:
    """(..., 90, 90, 180) the values of blocks (..., BLOCK_COUNT) in all their cells."""
    out = blocks.reshape(*blocks.shape[:-1], *BLOCKS)
    for axis, group in zip((-3, -2, -1), GROUP, strict=True):
        out = np.repeat(out, group, axis=axis)
    return out
