"""Integrals of smooth responses, by Gauss-Legendre nodes between their kinks."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import column_major
from illumcli.shading.terms import evaluate


def _response(model, polar, azimuth, eye):
    """(N,) red response to light from (polar, azimuth), seen from the angle `eye` at azimuth 0."""
    l = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], 1)
    v = np.stack(np.broadcast_arrays(np.sin(eye), 0.0, np.cos(eye)), -1)
    given = {"n": [0.0, 0.0, 1.0], "l": l, "v": v}
    given = {name: column_major(np.broadcast_to(value, l.shape)) for name, value in given.items()}
    return sum(evaluate(model.lobes(), given).values())[:, 0]


def _nodes(edges, count):
    """Nodes and weights over every interval between two edges."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = np.diff(edges)[:, None] / 2
    return (np.asarray(edges)[:-1, None] + half * (1 + node)).ravel(), (half * weight).ravel()


def albedo(model, cosine):
    """Share of the light from a direction at this cosine that is reflected; responses of which the kinks are
    at equal angles of light and eye, and at azimuths a right angle apart."""
    eye = np.arccos(cosine)
    theta, by_theta = _nodes([0, eye, np.pi / 2], 80)
    phi, by_phi = _nodes([0, np.pi / 2, np.pi], 80)
    polar, azimuth = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    weight = np.outer(by_theta * np.sin(theta), 2 * by_phi).ravel()
    return weight @ _response(model, polar, azimuth, eye)


def all_pairs(model, count=40):
    """BRDF, weight and larger angle to the normal of pairs of light and eye all over the hemisphere.

    The weights are by both cosines, and sum to 1.
    """
    theta, by_theta = _nodes([0, np.pi / 2], count)
    phi, by_phi = _nodes([0, np.pi], count)
    by_theta *= np.sin(2 * theta)
    polar, eye, azimuth = (grid.ravel() for grid in np.meshgrid(theta, theta, phi, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", by_theta, by_theta, by_phi / np.pi).ravel()
    return _response(model, polar, azimuth, eye) / np.cos(polar), weight, np.maximum(polar, eye)
