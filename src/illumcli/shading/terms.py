"""The words an illumination model may ask for: cosines, gaps and frame components, each formed stably.

A term is a function whose parameter names are the terms it needs; `evaluate` runs only those a lobe
reaches. The given words are the unit vectors `n` (shading normal), `l` (to the light), `v` (to the eye), `t`
(tangent, at right angles to `n`), and `light` (the light's colour, largest component 1).
With s = l + v: |s|^2 = 2 (1 + l.v) and h = s / |s|.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from illumcli.arrays import Lanes, Vectors, cross, dot, length, mirror, unit
from illumcli.demand import Recipe, order

GIVEN = ("n", "l", "v", "t", "light")


def n_l(n: Vectors, l: Vectors) -> Lanes:
    """Cosine of the angle of incidence, above 0 on every lane that a model sees."""
    return dot(n, l)


def n_v(n: Vectors, v: Vectors) -> Lanes:
    """Cosine at the eye, kept above 0: an interpolated normal may turn away where its facet does not."""
    cosine = np.abs(dot(n, v))
    return np.maximum(cosine, np.finfo(cosine.dtype).tiny)


def l_v(l: Vectors, v: Vectors) -> Lanes:
    return dot(l, v)


def s(l: Vectors, v: Vectors) -> Vectors:
    """l + v, the half vector before it is made unit."""
    return l + v


def s_s(s: Vectors) -> Lanes:
    """|s|^2 = 2 (1 + l.v)."""
    return dot(s, s)


def h(s: Vectors) -> Vectors:
    """Half vector; zero where the eye looks exactly from behind the light's direction."""
    return unit(s)


def v_h(s: Vectors) -> Lanes:
    """v.h = l.h = |s| / 2, without the cancellation of sqrt((1 + l.v) / 2)."""
    return length(s) / 2


def n_h(n: Vectors, h: Vectors) -> Lanes:
    return dot(n, h)


def gap_nh(n: Vectors, h: Vectors) -> Lanes:
    """1 - n.h = |n - h|^2 / 2; 1 (no highlight) where h is undefined."""
    d = n - h
    return dot(d, d) / 2 + (dot(h, h) == 0)


def r(l: Vectors, n: Vectors, n_l: Lanes) -> Vectors:
    """`l` mirrored at `n`."""
    return mirror(l, n, n_l)


def gap_rv(r: Vectors, v: Vectors) -> Lanes:
    """1 - r.v = |r - v|^2 / 2."""
    d = r - v
    return dot(d, d) / 2


def nxs(n: Vectors, s: Vectors) -> Vectors:
    return cross(n, s)


def tan2_h(nxs: Vectors, n: Vectors, s: Vectors) -> Lanes:
    """tan^2 of the angle between n and h = |n x s|^2 / (n.s)^2."""
    return dot(nxs, nxs) / np.square(dot(n, s))


def sin_l(n: Vectors, l: Vectors) -> Lanes:
    """Sine of the angle of incidence, |n x l|."""
    return length(cross(n, l))


def sin_v(n: Vectors, v: Vectors) -> Lanes:
    """Sine of the angle at the eye, |n x v|."""
    return length(cross(n, v))


def b(n: Vectors, t: Vectors) -> Vectors:
    """Bitangent n x t: across the grain where `t` runs along it."""
    return cross(n, t)


def t_l(t: Vectors, l: Vectors) -> Lanes:
    return dot(t, l)


def t_v(t: Vectors, v: Vectors) -> Lanes:
    return dot(t, v)


def b_l(b: Vectors, l: Vectors) -> Lanes:
    return dot(b, l)


def b_v(b: Vectors, v: Vectors) -> Lanes:
    return dot(b, v)


TERMS: dict[str, Recipe] = {
    f.__name__: Recipe.of(f)
    for f in (n_l, n_v, l_v, s, s_s, h, v_h, n_h, gap_nh, r, gap_rv, nxs, tan2_h, sin_l, sin_v, b, t_l, t_v, b_l, b_v)
}


def evaluate(lobes: dict[str, Callable[..., Any]], given: dict[str, Any]) -> dict[str, Any]:
    """Each lobe's value on the lanes of `given`; terms that lobes share are formed once."""
    book = TERMS | {name: Recipe.of(lobe, name) for name, lobe in lobes.items()}
    buffers = dict(given)
    for recipe in order(book, lobes, given):
        buffers[recipe.makes] = recipe.make(buffers)
    return {name: buffers[name] for name in lobes}


def words(lobes: dict[str, Callable[..., Any]]) -> frozenset[str]:
    """The given words (`n`, `l`, `v`, `t`, `light`) that these lobes reach."""
    book = TERMS | {name: Recipe.of(lobe, name) for name, lobe in lobes.items()}
    steps = order(book, lobes, GIVEN)
    return frozenset(need for step in steps for need in step.needs.values() if need in GIVEN)
