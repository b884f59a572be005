"""Terms that illumination models ask for: cosines, gaps and frame components, in numerically stable forms.

A term is a function whose parameter names are the terms that it needs; `evaluate` computes only those that a
lobe needs, directly or not. Given are the unit vectors `n` (shading normal), `l` (to the light), `v` (to the
eye), `t` (tangent, perpendicular to `n`), and `light` (the light's colour, largest component 1).
With s = l + v: |s|^2 = 2 (1 + l.v) and h = s / |s|. `b` is n x t. A gap is 1 minus a cosine.

Cosines in denominators (`n_v`, `n_h`) are at least the machine epsilon: smaller values are only rounding
noise, and no quotient overflows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from illumcli.arrays import Floats, Vectors, cross, dot, length, mirror, unit
from illumcli.graph import Node, required, topological_order
from illumcli.models._terms import Angle, Components
from illumcli.shading.untested import is_tested, mended_values, unknown_term

GIVEN = ("n", "l", "v", "t", "light")


def n_l(n: Vectors, l: Vectors) -> Floats:
    """Cosine of the angle of incidence; positive wherever a model is evaluated."""
    return dot(n, l)


def n_v(n: Vectors, v: Vectors) -> Floats:
    """Cosine at the eye, kept positive: an interpolated normal may face away where its polygon does not."""
    cosine = np.abs(dot(n, v))
    return np.maximum(cosine, np.finfo(cosine.dtype).eps)


def l_v(l: Vectors, v: Vectors) -> Floats:
    return dot(l, v)


def s(l: Vectors, v: Vectors) -> Vectors:
    """l + v, the half vector before it is normalized."""
    return l + v


def s_s(s: Vectors) -> Floats:
    """|s|^2 = 2 (1 + l.v)."""
    return dot(s, s)


def h(s: Vectors) -> Vectors:
    """Half vector; zero where `l` and `v` are exactly opposite."""
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
    """sin^2 of the angle between n and h = |n x s|^2 / |s|^2, accurate where 1 - (n.h)^2 cancels.

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
    """Cosine of the azimuth between l and v; 0 where one of them is along the normal and has no azimuth."""
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


def l_local(t_l: Floats, b_l: Floats, n_l: Floats) -> Components:
    """l along the grain, across it, and along the normal."""
    return Components(t_l, b_l, n_l)


def v_local(t_v: Floats, b_v: Floats, n_v: Floats) -> Components:
    """v along the grain, across it, and along the normal, kept above the surface."""
    return Components(t_v, b_v, n_v)


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
    b, t_l, t_v, b_l, b_v, t_s, b_s, s_local, l_local, v_local, sin_tl, sin_tv,
)
# fmt: on
TERMS: dict[str, Node] = {function.__name__: Node.of(function) for function in FUNCTIONS}


@cache
def ordered_terms(needs: tuple[str, ...], given: tuple[str, ...] = GIVEN) -> tuple[Node, ...]:
    """The terms that `needs` depend on, each after the terms it is computed from."""
    return tuple(topological_order(TERMS, needs, given))


def evaluate(
    lobes: dict[str, Callable[..., Any]], given: dict[str, Any], mended: Counter[str] | None = None
) -> dict[str, Any]:
    """The value of each lobe at N points; terms that lobes share are computed once.

    Parameters
    ----------
    lobes : dict
        Name -> function of terms, as from a model's `lobes()`.
    given : dict
        The given terms that the lobes need (`given_terms`): (N, 3) vectors of one precision, in column-major
        order. Other terms may be given, too, if they are already known.
    mended : Counter, optional
        Of lobes that no test covers, the number of values that are 0 because they were negative or not
        finite is added here, by the lobe's name.

    Returns
    -------
    dict
        Name -> (N, 3), in the precision of the given terms.
    """
    buffers = dict(given)
    for node in ordered_terms(_needs(lobes), tuple(given)):
        buffers[node.output] = node.run(buffers)
    counted = Counter[str]() if mended is None else mended
    values = {}
    for name, lobe in lobes.items():
        needed = {need: buffers[need] for need in required(lobe)}
        if is_tested(lobe):
            values[name] = lobe(**needed)
        else:
            values[name] = mended_values(lobe, needed, given["l"], counted, name)
    return values


def given_terms(lobes: dict[str, Callable[..., Any]]) -> frozenset[str]:
    """The given terms (`n`, `l`, `v`, `t`, `light`) that these lobes need, directly or not."""
    needs = _needs(lobes)
    inputs = {need for node in ordered_terms(needs) for need in node.inputs.values()}
    return frozenset(inputs.union(needs).intersection(GIVEN))


def _needs(lobes: dict[str, Callable[..., Any]]) -> tuple[str, ...]:
    for lobe in lobes.values():
        for need in required(lobe):
            if need not in TERMS and need not in GIVEN:
                raise unknown_term(lobe, need, (*TERMS, *GIVEN))
    return tuple(dict.fromkeys(need for lobe in lobes.values() for need in required(lobe)))
