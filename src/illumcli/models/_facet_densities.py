"""Densities p(h) of facet normals: a formula, a table over angles, or a drawing, at any normal.

h has components along the grain (t), across it (b) and along the surface's normal (n). The lean of a facet is
(x, y) = (h_t, h_b) / h_n; the surface's slopes are (-x, -y). Values are float64 unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.formula import Formula, parse
from illumcli.measured_files.angle_tables import AngleTable
from illumcli.models._facet_quadrature import Array, Facets, disc_nodes, square_nodes
from illumcli.models._warp import between
from illumcli.records import Record

Pixels: TypeAlias = NDArray[np.float32]
ReadPixels: TypeAlias = Callable[[str], Pixels]
"""Path of an image -> (H, W, 3) numbers as stored, the first row on top; black where it is transparent."""

VARIABLES = ("theta", "phi", "slope", "x", "y", "ht", "hb", "hn")
ROUND = ("theta", "slope", "hn")
"""Variables that are the same all around the normal."""
NEAREST = 1e-14
"""Lean at which a formula is evaluated for the normal itself, which has no phi."""
LARGEST_SIDE = 1 << 13
"""Of a drawing [pixels]."""
SIDE = 512
"""The integrals of a drawing take pixels together so that it has at most so many along a side."""
NODES = 1 << 18
"""About as many nodes are enough for the integrals of a drawing."""


class Density(Protocol):
    """p at facet normals."""

    @property
    def is_round(self) -> bool:
        """True if p depends on theta alone."""

    def value(self, h: Array) -> Array:
        """p at (3, ...) unit normals with h_n > 0, finite and not negative."""

    def colors(self, h: NDArray[np.floating]) -> NDArray[np.floating]:
        """(N,), or (3, N) if the facets are coloured: p times the colour, at (3, N) normals."""


class FormulaDensity(Record):
    """p by a formula."""

    formula: Formula

    @property
    def is_round(self) -> bool:
        return self.formula.names.issubset(ROUND)

    def raw(self, h: Array) -> Array:
        """The formula itself."""
        t, b, n = h
        t = np.where((t == 0) & (b == 0), NEAREST, t)
        across = np.hypot(t, b)
        variables: dict[str, Callable[[], Array]] = {
            "theta": lambda: np.arctan2(across, n),
            "phi": lambda: np.arctan2(b, t),
            "slope": lambda: across / n,
            "x": lambda: t / n,
            "y": lambda: b / n,
            "ht": lambda: t,
            "hb": lambda: b,
            "hn": lambda: n,
        }
        used = [variables[name]() if name in self.formula.names else 0.0 for name in VARIABLES]
        return np.broadcast_to(self.formula.value(*used), n.shape)

    def value(self, h: Array) -> Array:
        p = self.raw(h)
        return np.where(np.isfinite(p), np.maximum(p, 0), 0)

    def colors(self, h: NDArray[np.floating]) -> NDArray[np.floating]:
        return self.value(h.astype(np.float64))


def formula_density(text: str) -> FormulaDensity:
    """p by the formula in `text`.

    Raises
    ------
    ValueError
        Text that is no formula, see `formula.parse`.
    """
    return FormulaDensity(parse(text, VARIABLES))


class TableDensity(Record):
    """p by a table over theta and phi, linear between its angles."""

    theta: Array  # (R,) [radians]
    values: Array  # (R, C); C = 1 for all phi, else phi goes all around and the first phi is repeated last
    phi: Array  # (C,) [radians], from 0 or below to 2 pi or above

    @property
    def is_round(self) -> bool:
        return self.values.shape[1] == 1

    def value(self, h: Array) -> Array:
        theta = np.arctan2(np.hypot(h[0], h[1]), h[2])
        row = between(self.theta, theta)
        if self.is_round:
            low, high = self.values[row.low, 0], self.values[row.high, 0]
        else:
            column = between(self.phi, np.arctan2(h[1], h[0]) % (2 * np.pi))
            low, high = (
                column.blend(self.values[at, column.low], self.values[at, column.high])
                for at in (row.low, row.high)
            )
        return np.where(theta <= self.theta[-1], row.blend(low, high), 0)

    def colors(self, h: NDArray[np.floating]) -> NDArray[np.floating]:
        return self.value(h.astype(np.float64))


def table_density(table: AngleTable) -> TableDensity:
    """p by a table. Of phi within 0..90 or 0..180 degrees the rest is mirrored, as in photometric files."""
    theta = np.radians(table.theta)
    if table.phi is None:
        return TableDensity(theta, table.values, np.zeros(1))
    phi, values = table.phi, table.values
    for end in (90.0, 180.0):
        if phi[-1] <= end:
            mirrored = phi < end
            phi = np.append(phi, 2 * end - phi[mirrored][::-1])
            values = np.append(values, values[:, mirrored][:, ::-1], axis=1)
    if phi[-1] == 360:  # the same direction as 0, where it is there too
        phi, values = (phi[:-1], values[:, :-1]) if phi[0] == 0 else (phi, values)
    around = np.concatenate([phi[-1:] - 360, phi, phi[:1] + 360])
    return TableDensity(
        theta, np.take(values, np.arange(-1, len(phi) + 1), 1, mode="wrap"), np.radians(around)
    )


class DrawnDensity(Record):
    """p, or the share of the surface per area of leans, by an image; bilinear between the pixels' centres."""

    planes: Array  # (1, H * W) grey, or (3, H * W) colours
    peak: Array  # (H * W,) the largest channel
    size: tuple[int, int]  # H, W
    extent: tuple[float, float]  # rows and columns from one border to the other; the last may be cut
    span: tuple[float, float] | None  # leans at the borders; None for the projected disc

    @property
    def is_round(self) -> bool:
        return False

    def value(self, h: Array) -> Array:
        flat = h.reshape(3, -1)
        return self._at(self.peak[None], flat)[0].reshape(h.shape[1:])

    def colors(self, h: NDArray[np.floating]) -> NDArray[np.floating]:
        at = self._at(self.planes.astype(h.dtype), h)
        return at[0] if len(at) == 1 else at

    def _at(self, planes: NDArray[np.floating], h: NDArray[np.floating]) -> NDArray[np.floating]:
        """(C, N) values at (3, N) normals."""
        # The place in the image, in pixels from its upper left corner.
        t, b, n = h
        if self.span is None:
            x, y = t, b
        else:
            x, y = (lean / (n * h.dtype.type(most)) for lean, most in zip((t, b), self.span, strict=True))
        inside = (np.abs(x) <= 1) & (np.abs(y) <= 1)
        rows, columns = (
            np.clip((1 + sign * each) * h.dtype.type(extent / 2) - h.dtype.type(0.5), 0, count - 1)
            for sign, each, extent, count in zip((-1, 1), (y, x), self.extent, self.size, strict=True)
        )

        # Between the four nearest pixels; a lean's share of the surface is D cos(theta)^4.
        top, left = np.floor(rows), np.floor(columns)
        down, right = rows - top, columns - left
        first = top.astype(np.int64) * self.size[1] + left.astype(np.int64)
        below = self.size[1] * (top < self.size[0] - 1)
        beside = left < self.size[1] - 1
        factor = inside if self.span is None else inside / np.square(np.square(n))
        upper = planes.take(first, 1) * (1 - right) + planes.take(first + beside, 1) * right
        lower = planes.take(first + below, 1) * (1 - right) + planes.take(first + below + beside, 1) * right
        return (upper * (1 - down) + lower * down) * factor

    def facets(self) -> Facets:
        """Nodes of a quadrature; a drawing that is mostly black is sampled more finely."""
        small = self._small()
        fine, coarse = (Facets(*small._nodes(step)) for step in (1, 2))
        return Facets(fine.h, fine.weight, coarse)

    def _small(self) -> DrawnDensity:
        """This drawing by the means of blocks of pixels, at most `SIDE` along a side."""
        block = -(-max(self.size) // SIDE)
        if block == 1:
            return self
        height, width = (-(-count // block) for count in self.size)
        padded = np.zeros((height * block, width * block))
        padded[: self.size[0], : self.size[1]] = self.peak.reshape(self.size)
        means = padded.reshape(height, block, width, block).mean(axis=(1, 3)).ravel()
        extent = (self.extent[0] / block, self.extent[1] / block)
        return DrawnDensity(means[None], means, (height, width), extent, self.span)

    def _nodes(self, step: int) -> tuple[Array, Array]:
        """(3, N) normals with facets, and (N,) p times their solid angles; `step` 2 has a quarter of them."""
        for fine in (2, 1):
            if self.span is None:
                h, solid = disc_nodes(320 * fine // step)
            else:
                rows, columns = (_nodes_along(count) * fine // step for count in self.size)
                h, solid = square_nodes((columns, rows), self.span)
            p = self.value(h)
            lit = p > 0
            if fine == 1 or np.count_nonzero(lit) * step**2 <= NODES:
                break
        return h[:, lit], (p * solid)[lit]


def _nodes_along(pixels: int) -> int:
    """Nodes along a side of so many pixels: one in each, or as many in each half of a pixel."""
    least = 3 * SIDE // 4
    return pixels if pixels >= least else 2 * pixels * -(-least // (2 * pixels))


def drawn_density(path: str, pixels: Pixels, span: tuple[float, float] | None) -> tuple[DrawnDensity, int]:
    """p by an image of leans up to `span`, or of the projected disc; and how many values were below 0.

    Raises
    ------
    InputError
        A disc that is not square, or a black image.
    """
    height, width = pixels.shape[:2]
    if span is None and height != width:
        raise InputError(f"{path}: a disc's image must be square, is {width} x {height} pixels; crop it")
    if max(height, width) > LARGEST_SIDE:
        raise LimitError(
            f"{path}: {width} x {height} pixels; a drawing has at most {LARGEST_SIDE} along a side"
        )
    negative = int(np.count_nonzero(pixels < 0))
    planes = np.maximum(pixels, 0).reshape(-1, 3).T.astype(np.float64)
    peak = planes.max(axis=0)
    if not peak.any():
        raise InputError(f"{path}: is black and has no facets; draw them bright")
    if (planes == planes[0]).all():
        planes = planes[:1]
    # A common factor keeps sums and squares finite, whatever the image's unit.
    planes, peak = planes / peak.max(), peak / peak.max()
    return DrawnDensity(planes, peak, (height, width), (float(height), float(width)), span), negative
