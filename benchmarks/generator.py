"""How well does the generator know its masking, and does it conserve energy and reciprocity?

Reference: Smith's closed forms, and 1. Seed 0; mixtures of one to three lobes at random places in the
plane of leans, most of which lean on the whole. The albedo is an integral over 400 x 400 leans of facets.

    PYTHONPATH=src python benchmarks/generator.py [DISTRIBUTIONS]
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from illumcli.models._terms import Components
from illumcli.models.generated import Generated
from illumcli.shading.terms import evaluate

SIDE = 400


def by_formula(text: str) -> Generated:
    """Facets that are perfect mirrors."""
    keys = {
        "distribution": {"formula": text, "p": "formula"},
        "specular_weight": 1.0,
        "fresnel": {"F": "constant"},
    }
    return Generated.model_validate(keys)


def closed_forms() -> None:
    """Worst relative error of the projected area over 15,000 directions, and what the table estimates."""
    theta, phi = np.meshgrid(np.linspace(0.003, np.pi / 2 - 1e-3, 150), np.linspace(-3.1, 3.14, 100))
    k = Components(
        *(x.ravel() for x in (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)))
    )
    erf = np.vectorize(math.erf)
    print("distribution, widths: worst error, estimated, processor seconds")
    for name in ("beckmann", "ggx"):
        for c, d in ((0.001, 0.001), (0.3, 0.3), (3, 3), (0.1, 0.5), (0.01, 1)):
            spread = np.hypot(c * k.t, d * k.b)
            a = k.n / spread
            if name == "ggx":
                text, expected = (
                    f"((ht / {c})**2 + (hb / {d})**2 + hn**2)**(-2)",
                    (k.n + np.hypot(k.n, spread)) / 2,
                )
            else:
                text = f"exp(-(x / {c})**2 - (y / {d})**2) / hn**4"
                expected = k.n * (1 + (erf(a) - 1) / 2 + np.exp(-a * a) / (2 * a * np.sqrt(np.pi)))
            if c == d:
                text = text.replace("x /", "slope /").replace(f" - (y / {d})**2", "")
                text = text.replace(f"(ht / {c})**2 + (hb / {d})**2", f"(sin(theta) / {c})**2")
            start = time.process_time()
            surface = by_formula(text).distribution.microsurface(None)
            seconds = time.process_time() - start
            area = surface.area.of_angle(k.n) if c == d else surface.area.of_direction(k)
            worst = np.abs(area / expected - 1).max()
            print(f"{name} {c} {d}: {worst:.1e}, {surface.area.error:.1e}, {seconds:.2f}")


def mixture(random: np.random.Generator) -> str:
    """One to three lobes in the plane of leans."""
    lobes = [
        f"{w:.3f}*exp(-((x - ({a:.3f})) / {c:.3f})**2 - ((y - ({b:.3f})) / {d:.3f})**2)"
        for a, b, c, d, w in (
            (*random.uniform(-0.8, 0.8, 2), *random.uniform(0.1, 1, 2), random.uniform(0.1, 1))
            for _ in range(random.integers(1, 4))
        )
    ]
    return f"({' + '.join(lobes)}) / hn**4"


def albedo(model: Generated, angle: float, turn: float) -> tuple[float, float]:
    """The share of light from a direction that is reflected, and the worst relative asymmetry met."""
    u = (np.arange(SIDE) + 0.5) * 2 / SIDE - 1
    lean, step = u / (1 - np.abs(u)), (2 / SIDE) / (1 - np.abs(u)) ** 2
    x, y = (grid.ravel() for grid in np.meshgrid(lean, lean))
    size = 1 / np.sqrt(1 + x * x + y * y)
    h = np.stack([x * size, y * size, size], axis=1)
    solid = np.outer(step, step).ravel() * size**3
    l = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
    cosine = h @ l
    v = 2 * cosine[:, None] * h - l
    lit = (cosine > 0) & (v[:, 2] > 0)
    vectors = {"n": [0.0, 0.0, 1.0], "t": [1.0, 0.0, 0.0], "l": l}
    given = {name: np.asfortranarray(np.tile(each, (lit.sum(), 1))) for name, each in vectors.items()}
    given |= {"v": np.asfortranarray(v[lit])}
    there = sum(evaluate(model.lobes(), given).values())[:, 0] / l[2]
    back = sum(evaluate(model.lobes(), given | {"l": given["v"], "v": given["l"]}).values())[:, 0] / v[lit, 2]
    total = float((there * v[lit, 2] * 4 * cosine[lit] * solid[lit]).sum())
    bright = there > 1e-6 * there.max(initial=0)
    return total, float(np.abs(back[bright] / there[bright] - 1).max(initial=0))


def random_distributions(count: int) -> None:
    """Largest and smallest albedo, and the worst asymmetry, of random distributions."""
    random = np.random.default_rng(0)
    shares, asymmetries = [], []
    for _ in range(count):
        model = by_formula(mixture(random))
        for angle in np.radians([0, 30, 60, 80]):
            share, asymmetry = albedo(model, angle, random.uniform(0, 2 * np.pi))
            shares.append(share)
            asymmetries.append(asymmetry)
    print(
        f"{count} random distributions, 4 angles: albedo {min(shares):.4f} to {max(shares):.4f}, "
        f"asymmetry at most {max(asymmetries):.1e}"
    )


if __name__ == "__main__":
    closed_forms()
    random_distributions(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
