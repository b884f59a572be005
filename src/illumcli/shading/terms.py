"""Terms that an illumination model may ask for: cosines, gaps and frame components, each computed stably.

A term is a function whose parameter names are the terms it needs; `evaluate` runs only those a lobe
reaches. The given words are the unit vectors `n` (shading normal), `l` (to the light), `v` (to the eye), `t`
(tangent, at right angles to `n`), and `light` (the light's colour, largest component 1).
With s = l + v: |s|^2 = 2 (1 + l.v) and h = s / |s|. `b` is n x t.

Cosines that stand in denominators (`n_v`, `n_h`) are kept at or above the rounding level of one: below it
their digits are noise, and no quotient overflows.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from illumcli.arrays import Floats, Vectors, cross, dot, length, mirror, unit
from illumcli.graph import Node, required, topological_order
from illumcli.models._terms import Angle, Components

GIVEN = ("n", "l", "v", "t", "light")


def n_l(n: Vectors, l: Vectors) -> Floats:
    """Cosine of the angle of incidence, above 0 on every lane that a model sees."""
    return dot(n, l)


def n_v(n: Vectors, v: Vectors) -> Floats:
    """Cosine at the eye, kept above 0: an interpolated normal may turn away where its facet does not."""
    cosine = np.abs(dot(n, v))
    return np.maximum(cosine, np.finfo(cosine.dtype).eps)


def l_v(l: Vectors, v: Vectors) -> Floats:
    return dot(l, v)


def s(l: Vectors, v: Vectors) -> Vectors:
    """l + v, the half vector before it is made unit."""
    return l + v


def s_s(s: Vectors) -> Floats:
    """|s|^2 = 2 (1 + l.v)."""
    return dot(s, s)


def h(s: Vectors) -> Vectors:
    """Half vector; zero where the eye looks exactly from behind the light's direction."""
    return unit(s)


def v_h(s_s: Floats) -> Floats:
    """v.h = l.h = |s| / 2, without the cancellation of sqrt((1 + l.v) / 2)."""
    return np.minimum(np.sqrt(s_s) / 2, 1)


def n_s(n: Vectors, s: Vectors) -> Floats:
    """n.s, equal to n.l + n.v."""
    return dot(n, s)


def n_h(n_s: Floats, s_s: Floats) -> Floats:
    """Cosine between normal and half vector, within (0, 1]."""
    limits = np.finfo(s_s.dtype)
    return np.clip(n_s / np.sqrt(np.maximum(s_s, limits.tiny)), limits.eps, 1)


def gap_nh(n: Vectors, h: Vectors, s_s: Floats) -> Floats:
    """1 - n.h = |n - h|^2 / 2; at least 1 (no highlight) where h is undefined."""
    d = n - h
    return dot(d, d) / 2 + (s_s == 0)


def r(l: Vectors, n: Vectors, n_l: Floats) -> Vectors:
    """`l` mirrored at `n`."""
    return mirror(l, n, n_l)


def gap_rv(r: Vectors, v: Vectors) -> Floats:
    """1 - r.v = |r - v|^2 / 2."""
    d = r - v
    return dot(d, d) / 2


def nxs(n: Vectors, s: Vectors) -> Vectors:
    return cross(n, s)


def sin2_h(nxs: Vectors, n_s: Floats, s_s: Floats) -> Floats:
    """sin^2 of the angle between n and h = |n x s|^2 / |s|^2; keeps its digits where 1 - (n.h)^2 has none.

    1 (a right angle) where h is undefined or below the surface.
    """
    sin2 = dot(nxs, nxs) / np.maximum(s_s, np.finfo(s_s.dtype).tiny)
    return np.maximum(sin2, n_s <= 0)


def theta_h(n_h: Floats, sin2_h: Floats) -> Angle:
    """Angle between normal and half vector."""
    return Angle(n_h, sin2_h)


def nxl(n: Vectors, l: Vectors) -> Vectors:
    return cross(n, l)


def nxv(n: Vectors, v: Vectors) -> Vectors:
    return cross(n, v)


def sin_l(nxl: Vectors) -> Floats:
    """Sine of the angle of incidence, |n x l|."""
    return length(nxl)


def sin_v(nxv: Vectors) -> Floats:
    """Sine of the angle at the eye, |n x v|."""
    return length(nxv)


def cos_phi(nxl: Vectors, nxv: Vectors, sin_l: Floats, sin_v: Floats) -> Floats:
    """Cosine of the azimuth between l and v; 0 where either stands on the normal and has none."""
    sines = sin_l * sin_v
    return np.clip(dot(nxl, nxv) / np.maximum(sines, np.finfo(sines.dtype).tiny), -1, 1)


def d(l: Vectors, v: Vectors) -> Vectors:
    """l - v, at right angles to s."""
    return l - v


def sin_theta_d(d: Vectors) -> Floats:
    """Sine of the angle between l and h = |l - v| / 2."""
    return length(d) / 2


def b(n: Vectors, t: Vectors) -> Vectors:
    """Bitangent n x t: across the grain where `t` runs along it."""
    return cross(n, t)


def t_l(t: Vectors, l: Vectors) -> Floats:
    return dot(t, l)


def t_v(t: Vectors, v: Vectors) -> Floats:
    return dot(t, v)


def b_l(b: Vectors, l: Vectors) -> Floats:
    return dot(b, l)


def b_v(b: Vectors, v: Vectors) -> Floats:
    return dot(b, v)


def t_s(t: Vectors, s: Vectors) -> Floats:
    return dot(t, s)


def b_s(b: Vectors, s: Vectors) -> Floats:
    return dot(b, s)


def s_local(t_s: Floats, b_s: Floats, n_s: Floats) -> Components:
    """s along the grain, across it, and along the normal."""
    return Components(t_s, b_s, n_s)


def sin_tl(t: Vectors, l: Vectors) -> Floats:
    """Sine of the angle between tangent and light, |t x l|."""
    return length(cross(t, l))


def sin_tv(t: Vectors, v: Vectors) -> Floats:
    """Sine of the angle between tangent and eye, |t x v|."""
    return length(cross(t, v))


# fmt: off
FUNCTIONS = (
    n_l, n_v, l_v, s, s_s, h, v_h, n_s, n_h, gap_nh, r, gap_rv,
    nxs, sin2_h, theta_h, nxl, nxv, sin_l, sin_v, cos_phi, d, sin_theta_d,
    b, t_l, t_v, b_l, b_v, t_s, b_s, s_local, sin_tl, sin_tv,
)
# fmt: on
TERMS: dict[str, Node] = {function.__name__: Node.of(function) for function in FUNCTIONS}


@cache
def steps(needs: tuple[str, ...], given: tuple[str, ...] = GIVEN) -> tuple[Node, ...]:
    """The terms that `needs` reach, each after those it is formed from."""
    return tuple(topological_order(TERMS, needs, given))


def evaluate(lobes: dict[str, Callable[..., Any]], given: dict[str, Any]) -> dict[str, Any]:
    """Each lobe's value on the lanes of `given`; terms that lobes share are formed once.

    Parameters
    ----------
    lobes : dict
        Name -> function of terms, as a model's `lobes()` has them.
    given : dict
        The words the lobes reach: (N, 3) vectors of one precision, column by column in memory. Terms that
        are known already may be given too.

    Returns
    -------
    dict
        Name -> (N, 3), in the precision of the lanes.
    """
    buffers = dict(given)
    for recipe in steps(_needs(lobes), tuple(given)):
        buffers[recipe.output] = recipe.run(buffers)
    return {name: lobe(**{need: buffers[need] for need in required(lobe)}) for name, lobe in lobes.items()}


def words(lobes: dict[str, Callable[..., Any]]) -> frozenset[str]:
    """The given words (`n`, `l`, `v`, `t`, `light`) that these lobes reach."""
    needs = _needs(lobes)
    reached = {need for step in steps(needs) for need in step.inputs.values()}
    return frozenset(reached.union(needs).intersection(GIVEN))


def _needs(lobes: dict[str, Callable[..., Any]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(need for lobe in lobes.values() for need in required(lobe)))
