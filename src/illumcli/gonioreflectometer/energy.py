"""How much of the light a measured surface reflects, by the direction that it comes from."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import Floats, dot, mirror
from illumcli.gonioreflectometer.directions import half_angles
from illumcli.gonioreflectometer.table import Table
from illumcli.measured_files.merl import SHAPE, cell_numbers
from illumcli.records import Record

AROUND = 180
"""Azimuths of half vectors over which a MERL table is summed."""
COARSE = 0.02
"""Error of the sum over cells, within which the BRDF varies."""
INCIDENCE = np.arange(5.0, 90.0, 10.0)
"""Of the light [degrees]."""


class Albedos(Record):
    """Directional-hemispherical reflectance; what was not measured counts as 0."""

    theta: Floats  # (I,) [degrees]
    phi: Floats  # (I,) [degrees]
    values: Floats  # (3, I)
    errors: Floats  # (3, I)

    def excess(self) -> list[str]:
        """Lines about directions from which more light is reflected than arrives.

        Beyond three standard errors and `COARSE`.
        """
        most = np.argmax(self.values - 3 * self.errors, axis=0)
        each = np.arange(len(self.theta))
        value, error = self.values[most, each], self.errors[most, each]
        return [
            f"light from {self.theta[i]:.0f} degrees (azimuth {self.phi[i]:.0f}) is reflected "
            f"{value[i]:.3f} times, +- {error[i]:.3f}"
            for i in np.flatnonzero(value - 3 * error > 1 + COARSE)
        ]


def albedos(table: Table) -> Albedos:
    """The albedos of a table at its directions of light, of a MERL table at nine angles."""
    if table.is_isotropic:
        return _of_merl(table)
    grid = table.grid()
    weights = grid.projected
    count = len(grid)
    f = np.nan_to_num(table.brdf.reshape(3, count, count).astype(np.float64))
    e = np.nan_to_num(table.standard_error.reshape(3, count, count).astype(np.float64))
    return Albedos(np.degrees(grid.theta), np.degrees(grid.phi), f @ weights, np.sqrt(e**2 @ weights**2))


def _of_merl(table: Table) -> Albedos:
    """The integral of f_r n.v d omega_v = f_r n.v 4 (l.h) d omega_h, by rows of the table."""
    edges = (np.arange(2 * SHAPE[0] + 1) / (2 * SHAPE[0])) ** 2 * (np.pi / 2)
    theta = np.repeat((edges[1:] + edges[:-1]) / 2, AROUND)
    phi = np.tile((np.arange(AROUND) + 0.5) * (2 * np.pi / AROUND), len(edges) - 1)
    h = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    solid_angle = np.repeat(-np.diff(np.cos(edges)) * (2 * np.pi / AROUND), AROUND)

    f, e = (np.nan_to_num(each.reshape(3, -1)) for each in (table.brdf, table.standard_error))
    values, errors = np.zeros((2, 3, len(INCIDENCE)))
    for i, incidence in enumerate(np.radians(INCIDENCE)):
        l = np.broadcast_to([np.sin(incidence), 0.0, np.cos(incidence)], h.shape)
        l_h = dot(l, h)
        v = mirror(l, h, l_h)
        weights = np.maximum(v[:, 2], 0) * 4 * np.maximum(l_h, 0) * solid_angle
        seen = np.flatnonzero(weights > 0)
        cell = cell_numbers(*half_angles(l[seen], v[seen]))[3]
        values[:, i] = f[:, cell].astype(np.float64) @ weights[seen]
        # Errors of one cell come together, those of others do not.
        of_cell = np.bincount(cell, weights[seen], f.shape[1])
        errors[:, i] = np.sqrt(np.square(e, dtype=np.float64) @ of_cell**2)
    return Albedos(INCIDENCE, np.zeros(len(INCIDENCE)), values, errors)
