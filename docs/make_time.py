"""Writes scenes/time.png, the maps of scenes/drying.yaml, dusting.yaml and fading.yaml: 8 bits, linear.

red    thickness of a wet film that ran down: thick in drips and at the bottom
green  how fast dust settles on a ball: by the cosine to the vertical, in blotches
blue   the share of sun light behind a window with a cross and a plant
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from illumcli.images.writer import ImageWriter

MAPS = Path(__file__).parents[1] / "scenes" / "time.png"
SIZE = 128


def noise(random: np.random.Generator, cells: tuple[int, int]) -> np.ndarray:
    """(SIZE, SIZE) smooth noise within 0..1 that repeats: random values in cells, with cosines between."""
    values = random.random(cells)
    where = np.arange(SIZE) / SIZE
    for axis, count in enumerate(cells):
        place = where * count
        left = place.astype(int)
        share = (1 - np.cos(np.pi * (place - left))) / 2
        a, b = (np.take(values, (left + step) % count, axis) for step in (0, 1))
        share = np.expand_dims(share, 1 - axis)
        values = a + share * (b - a)
    return values


def maps() -> np.ndarray:
    """(SIZE, SIZE, 3) values within 0..1, the first row at the top."""
    random = np.random.default_rng(3)
    v, u = np.meshgrid(1 - (np.arange(SIZE) + 0.5) / SIZE, (np.arange(SIZE) + 0.5) / SIZE, indexing="ij")
    drips = np.clip(2.6 * noise(random, (2, 24)) - 1.2, 0, 1)
    film = 0.55 * (1 - v) + 0.3 * drips * (1 - v) ** 0.5 + 0.15 * noise(random, (9, 9))
    blotches = 0.35 + 0.4 * noise(random, (7, 7)) + 0.25 * noise(random, (31, 31))
    dust = blotches * np.clip(np.sin(np.pi * (v - 0.5)), 0, 1)
    pane = (np.abs(u - 0.5) > 0.035) & (np.abs(v - 0.55) > 0.03) & (np.abs(u - 0.5) < 0.38)
    pane &= (v > 0.12) & (v < 0.94)
    plant = (np.abs(u - 0.3 - 0.02 * np.sin(9 * v)) < 0.008) & (v < 0.48)
    for number, height in enumerate((0.17, 0.23, 0.29, 0.35, 0.41, 0.46)):
        side = (-1) ** number
        along = side * (u - 0.3) * np.cos(0.6) + (v - height) * np.sin(0.6)
        across = (v - height) * np.cos(0.6) - side * (u - 0.3) * np.sin(0.6)
        size = 0.13 - 0.015 * number
        plant |= (np.abs(across) < 0.28 * along * (1 - along / size) * 1.8) & (along > 0)
    sun = np.where(pane & ~plant, 1.0, 0.08)
    for axis in (0, 1):  # the sun is no point
        sun = sum(np.roll(sun, step, axis) for step in (-1, 0, 1)) / 3
    return np.stack([film, dust, sun], axis=2)


if __name__ == "__main__":
    pixels = np.round(255 * np.clip(maps(), 0, 1)).astype(np.uint8)
    with ImageWriter(MAPS, SIZE, SIZE, dict.fromkeys("RGB", "uint8"), {}) as writer:
        writer.write_band(0, pixels)
