"""Random numbers keyed by their purpose, and low-discrepancy point sets.

Every number is a hash of (seed, purpose, pixel or vertex number, sample), so it does not depend on the other
outputs, on tiles, threads or the order of calls.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.geometry.spatial_order import compact
from illumcli.rays.pattern_rays import CompactTable

U32 = np.uint32
GOLDEN = 0.6180339887498949
ROTATION_STEP = 3**0.5
"""Between spirals whose phases differ by the golden ratio, in turns."""
PLASTIC = 1.32471795724474602596
"""Root of x^3 = x + 1; 1/x and 1/x^2 step the R2 sequence (Roberts 2018)."""


def stream(seed: int, purpose: str) -> int:
    """The 32-bit key of the random numbers for one purpose."""
    return int.from_bytes(hashlib.blake2b(f"{seed}:{purpose}".encode(), digest_size=4).digest(), "little")


def hashed(key: int, number: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """(N,) uint32 random bits for each number: multiply and xorshift, twice (lowbias32, Wellons 2018)."""
    x = number ^ U32(key)
    for multiplier in (0x7FEB352D, 0x846CA68B):
        x = (x ^ (x >> U32(16))) * U32(multiplier)
        x ^= x >> U32(15)
    return (x ^ (x >> U32(16))) + U32(key)


def shuffled(key: int, number: NDArray[np.uint32]) -> NDArray[np.int64]:
    """(N,) order of numbers by their hashes; equal ones by index."""
    keys = hashed(key, number).astype(np.uint64) << np.uint64(32)
    keys |= np.arange(len(number), dtype=np.uint64)
    keys.sort()  # values without ties sort several times as fast as indices in a stable order
    return (keys & np.uint64(0xFFFFFFFF)).astype(np.int64)


def unit_interval(bits: NDArray[np.uint32]) -> NDArray[np.float64]:
    """[0, 1) float64 from 32 bits."""
    return np.multiply(bits, 2.0**-32, dtype=np.float64)


def kronecker(shifts: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """(..., count, D) points of the unit cube: the additive sequence of Roberts, shifted by (..., D) shifts.

    References
    ----------
    Roberts, M. (2018). The unreasonable effectiveness of quasirandom sequences.
    """
    dimensions = shifts.shape[-1]
    root = 1.5
    for _ in range(60):  # the root above 1 of x^(D + 1) = x + 1
        root = (1 + root) ** (1 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1)
    return (shifts[..., None, :] + np.arange(count)[:, None] * steps) % 1.0


@lru_cache(maxsize=32)
def sobol(count: int) -> NDArray[np.uint32]:
    """(2, count) uint32 the first points of Sobol's (0, 2)-sequence, bit-reversed for `owen`."""
    number = np.arange(count, dtype=U32)
    second, matrix, rest = np.zeros_like(number), U32(1 << 31), number.copy()
    while rest.any():
        second ^= np.where(rest & U32(1), matrix, U32(0))
        rest >>= U32(1)
        matrix ^= matrix >> U32(1)
    points = np.stack([number, reverse_bits(second)])
    points.setflags(write=False)
    return points


def reverse_bits(x: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Bits of each uint32 in reverse order."""
    x = x.byteswap()
    for shift, mask in ((4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x = ((x >> U32(shift)) & U32(mask)) | ((x & U32(mask)) << U32(shift))
    return x


def owen(reversed_bits: NDArray[np.uint32], seed: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Coordinates in [0, 1): a nested uniform scramble of bit-reversed points, by hashing.

    In each step a bit depends on lower bits only; on reversed input every digit therefore depends on the
    digits before it, as in Owen's scramble.

    References
    ----------
    Laine, S. and Karras, T. (2011). Stratified sampling for stochastic transparency. EGSR.
    Burley, B. (2020). Practical hash-based Owen scrambling. JCGT 9(4); constants of Vegdahl (2021).
    """
    x = reversed_bits ^ (reversed_bits * U32(0x3D20ADEA))
    x = x + seed
    x = x * ((seed >> U32(16)) | U32(1))
    x = x ^ (x * U32(0x05526C56))
    x = x ^ (x * U32(0x53A22864))
    return unit_interval(reverse_bits(x))


def pixel_points(key: int, pixel: NDArray[np.uint32], count: int) -> NDArray[np.float64]:
    """(N * count, 2) in [0, 1)^2: `count` points per pixel, an Owen-scrambled Sobol set each.

    One point is the pixel's centre; otherwise fewer points are the first of more.
    """
    if count == 1:
        return np.full((len(pixel), 2), 0.5, order="F")
    out = np.empty((2, len(pixel), count))
    for axis, base in enumerate(sobol(count)):
        seeds = hashed(key + axis & 0xFFFFFFFF, pixel)
        out[axis] = owen(base[None, :], seeds[:, None])
    return out.reshape(2, -1).T


SPIRAL_POINTS = 1 << 14
"""Points in a table of spirals, 196 kB: with the arrays of the rays, half of a core's share of the cache."""


@lru_cache(maxsize=64)
def spiral_table(count: int) -> NDArray[np.float32]:
    """(phases, 3, count) unit directions about +z, cosine-weighted: golden-angle spirals on the disc.

    Point i of phase k has r^2 = (i + (k + 1/2) / phases) / count. Directions that are uniform on the disc are
    cosine-weighted on the hemisphere; with a random phase every point is uniform in its own ring, so the mean
    is unbiased for any count. There are as many phases as fit the table, at least 16: the edge of an occluder
    around the zenith is resolved to 1 / (2 phases count) of the hemisphere, 3e-5 up to 1024 rays.
    """
    phases = max(16, SPIRAL_POINTS // count)
    i = np.arange(count)
    phase = (np.arange(phases)[:, None] + 0.5) / phases
    r2 = (i + phase) / count
    angle = 2 * np.pi * ((i * GOLDEN) % 1.0)
    r = np.sqrt(r2)
    table = np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1 - r2)], axis=1).astype(F)
    table.setflags(write=False)
    return table


@lru_cache(maxsize=64)
def compact_spiral_table(count: int) -> CompactTable:
    """`spiral_table` with rays of like directions beside each other, in boxes of 8, 16, 32, ... rays."""
    table = spiral_table(count)
    order = compact(table[len(table) // 2].T)
    compact_table = np.ascontiguousarray(table[:, :, order])
    compact_table.setflags(write=False)
    return CompactTable(compact_table, order.astype(np.int32))


def spiral_draws(key: int, number: NDArray[np.int64]) -> NDArray[np.float64]:
    """(2, N) in [0, 1): rotation and phase of the spiral of each number.

    The steps are rationally independent of each other and of the spiral's own angle, so the spirals of
    consecutive numbers together fill the disc evenly, and their errors tend to cancel.
    """
    start = unit_interval(hashed(key, np.array([0, 1], U32)))
    draws = np.stack([ROTATION_STEP * number + start[0], GOLDEN * number + start[1]])
    draws -= np.floor(draws)
    return draws


def dither(
    key: int, x: NDArray[np.int64], y: NDArray[np.int64], sample: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(2, N) in [0, 1): rotation and phase of each pixel's spiral, from the R2 sequence over the pixel grid.

    The errors of neighbouring pixels then tend to cancel: a small blur removes more of them than it would of
    independent noise. Samples of one pixel step like `spiral_draws`.
    """
    a, b = 1 / PLASTIC, 1 / PLASTIC**2
    start = unit_interval(hashed(key, np.array([0, 1], U32)))
    draws = np.stack(
        [a * x + b * y + ROTATION_STEP * sample + start[0], b * x + (a * b) * y + GOLDEN * sample + start[1]]
    )
    draws -= np.floor(draws)  # exact, as the remainder is, and a quarter of its time
    return draws
