"""Distributions of facet normals as scenes describe them, and the surfaces that they make."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Discriminator, Field

from illumcli.arrays import Floats, Vectors
from illumcli.errors import InputError
from illumcli.formula import MAX_LENGTH
from illumcli.measured_files._files import identity
from illumcli.measured_files.angle_tables import read_angle_table
from illumcli.models._facet_densities import (
    Density,
    DrawnDensity,
    ReadPixels,
    drawn_density,
    formula_density,
    table_density,
)
from illumcli.models._facet_quadrature import Array, cells, first_edges, panels
from illumcli.models._projected_area import ProjectedArea, of_angles, of_facets
from illumcli.records import Record
from illumcli.schema.description import Description
from illumcli.schema.fields import Pair, Positive, Shorthand

WORST = 0.02
"""Largest estimated error of the projected area that is not reported."""
ROUNDING = 1e-12
"""Values of a formula that are this much below 0, by its largest one, count as 0."""
HIGHEST = 1e30
"""Value of D that stays finite in single precision."""
UNREADABLE = "cannot be read"
"""What is wrong with a file that there is not, or that may not be read."""


class Microsurface(Record):
    """What the lobes of the model need of a distribution."""

    density: Density
    area: ProjectedArea
    mean_cosine: float
    """<h.n>, the mean of cos(theta) over the facets."""
    seen: float
    """The integral of p cos(theta); D = p / seen."""
    mended: int = 0
    """Values of a file that were negative or not finite, and count as 0."""

    @property
    def is_uncertain(self) -> bool:
        """True if the projected area may be off by more than `WORST`."""
        return self.area.error > WORST

    def has_grain(self) -> bool:
        """True if D depends on phi."""
        return not self.density.is_round

    def microsurface(self, read: ReadPixels | None) -> Microsurface:
        """The surface itself, in the place of its description."""
        return self

    def normalised(self, h: Vectors) -> Floats:
        """(N,), or (3, N) if facets are coloured: D at (3, N) facet normals, in their precision."""
        return np.minimum(self.density.colors(h) / self.seen, HIGHEST).astype(h.dtype)


def _checked(text: str) -> str:
    """A formula's text; refused if it is negative, not finite or 0 on a grid of normals."""
    density = formula_density(text)
    theta, phi = np.meshgrid(first_edges()[:-1] + 0.003, np.radians(np.arange(-178, 180, 4.0)))
    h = _normals(theta.ravel(), phi.ravel())
    p = density.raw(h)
    if fault := _fault(p, h):
        raise ValueError(fault)
    if not p.any():
        raise ValueError(
            f"is 0 at each of {p.size} normals, and has no facets; check its units: angles are radians"
        )
    return text


def _fault(p: Array, h: Array) -> str | None:
    """What is wrong with values of a formula at normals."""
    wrong = ~np.isfinite(p)
    fact = "is {} at theta = {:.4g}, phi = {:.4g}; write it so that it is finite, as with max(x, 1e-9)"
    if not wrong.any():
        wrong = p < -ROUNDING * np.abs(p).max()
        fact = "is {:.4g} at theta = {:.4g}, phi = {:.4g}; p must be at least 0, as max(0, ...) is"
    if not wrong.any():
        return None
    first = int(np.flatnonzero(wrong)[0])
    t, b, n = h[:, first]
    return fact.format(p[first], np.arctan2(np.hypot(t, b), n), np.arctan2(b, t))


def _normals(theta: Array, phi: Array) -> Array:
    sine = np.sin(theta)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)])


FormulaText: TypeAlias = Annotated[str, Field(max_length=MAX_LENGTH), AfterValidator(_checked)]


class ByFormula(Description):
    """A formula of the facet's normal."""

    p: Literal["formula"] = "formula"
    formula: FormulaText = "exp(-(slope / 0.3)**2) / hn**4"
    """p. theta is the angle to the normal and phi that from the grain [radians]; slope = tan(theta); x and y
    are the lean along and across the grain, tan(theta) cos(phi) and tan(theta) sin(phi); ht, hb and hn are
    the components of the facet's normal along the grain, across it and along the normal. Functions: sin cos
    tan sinh cosh tanh exp log sqrt abs atan2 mod min max."""

    def has_grain(self) -> bool:
        """True if the formula names more than theta, slope and hn."""
        return not formula_density(self.formula).is_round

    def microsurface(self, read: ReadPixels | None) -> Microsurface:
        """The surface of the formula, computed once."""
        return _of_formula(self.formula)


class ByProfile(Description):
    """A table of theta, the same all around."""

    p: Literal["profile"]
    file: str
    """Path of a CSV of two columns: theta [degrees] and p. Linear between the rows; below the first row as
    there, and 0 beyond the last one."""

    def has_grain(self) -> bool:
        """False."""
        return False

    def microsurface(self, read: ReadPixels | None) -> Microsurface:
        """The surface of the file, computed once while it does not change."""
        return _of_table(*identity(self.file, UNREADABLE), False)


class ByTable(Description):
    """A table of theta and phi."""

    p: Literal["table"]
    file: str
    """Path of a CSV: its first line has phi [degrees], from the second column on, every other line has theta
    and p at each phi. phi is 0 along the grain and 90 across it. If the last phi is at most 90, or at most
    180, the rest is mirrored, otherwise the columns go all around."""

    def has_grain(self) -> bool:
        """True."""
        return True

    def microsurface(self, read: ReadPixels | None) -> Microsurface:
        """The surface of the file, computed once while it does not change."""
        return _of_table(*identity(self.file, UNREADABLE), True)


class BySlopes(Description):
    """A drawing in the plane of slopes: how much of the surface, seen from above, leans which way."""

    p: Literal["slopes"]
    file: str
    """Path of the image, its centre a flat facet. To the right facets lean along the grain, upwards across.
    A pixel's number, without a colour curve, is the share of the surface: D = number / cos(theta)^4."""
    range: Annotated[Pair[Positive], Shorthand(lambda value: _both(value))] = (1.0, 1.0)
    """The slope at the right and left borders, and at the upper and lower ones: 1 is 45 degrees. One number
    is both."""

    def has_grain(self) -> bool:
        """True."""
        return True

    def microsurface(self, read: ReadPixels | None) -> Microsurface:
        """The surface of the image, computed once while the file does not change."""
        return _drawn(self.file, self.range, read)


class ByDisc(Description):
    """A drawing of the hemisphere of normals, seen from above."""

    p: Literal["disc"]
    file: str
    """Path of a square image, whose inscribed circle is the horizon. To the right facets lean along the
    grain, upwards across it. A pixel's number, without a colour curve, is p."""

    def has_grain(self) -> bool:
        """True."""
        return True

    def microsurface(self, read: ReadPixels | None) -> Microsurface:
        """The surface of the image, computed once while the file does not change."""
        return _drawn(self.file, None, read)


def _both(value: Any) -> Any:
    return (value, value) if isinstance(value, int | float) and not isinstance(value, bool) else value


FacetDistribution: TypeAlias = Annotated[
    ByFormula | ByProfile | ByTable | BySlopes | ByDisc, Discriminator("p")
]


# --- surfaces, each computed once ------------------------------------------------------------------------


@lru_cache(maxsize=64)
def _of_formula(text: str) -> Microsurface:
    density = formula_density(text)

    def value(h: Array) -> Array:
        p = density.raw(h)
        if fault := _fault(p, h):
            raise InputError(f"distribution.formula: {fault}")
        return np.maximum(p, 0)

    return _microsurface(density, value)


@lru_cache(maxsize=64)
def _of_table(path: str, modified: int, size: int, has_phi: bool) -> Microsurface:
    table = read_angle_table(path)
    if has_phi != (table.phi is not None):
        wanted, other = ("of theta and phi", "profile") if has_phi else ("of theta alone", "table")
        raise InputError(f"{path}: is no table {wanted}; write p: {other}")
    if not table.values.any():
        raise InputError(f"{path}: p is 0 everywhere, and there are no facets; give at least one row a value")
    density = table_density(table)
    return _microsurface(density, density.value, table.mended)


def _drawn(path: str, span: tuple[float, float] | None, read: ReadPixels | None) -> Microsurface:
    if read is None:
        raise InputError(f"{path}: nothing here reads images; use a table")
    return _of_image(*identity(path, UNREADABLE), span, read)


@lru_cache(maxsize=16)
def _of_image(
    path: str, modified: int, size: int, span: tuple[float, float] | None, read: ReadPixels
) -> Microsurface:
    density, negative = drawn_density(path, read(path), span)
    return _microsurface(density, density.value, negative)


def _microsurface(density: Density, value: Any, mended: int = 0) -> Microsurface:
    """The surface of a density; `value` is p at normals."""
    if isinstance(density, DrawnDensity):
        area, facets, seen = of_facets(density.facets())
    elif density.is_round:

        def around(theta: Array) -> Array:
            return value(_normals(theta.ravel(), np.zeros(theta.size))).reshape(theta.shape)

        area, facets, seen = of_angles(around, panels(around))
    else:
        area, facets, seen = of_facets(cells(value))
    return Microsurface(density, area, seen / facets, seen, mended)
