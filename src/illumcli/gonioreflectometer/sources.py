"""Surfaces from a formula, a picture of heights, or a mesh file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from illumcli.color import luminance
from illumcli.errors import InputError, LimitError
from illumcli.formula import parse
from illumcli.geometry.triangulate import triangulate
from illumcli.gonioreflectometer.settings import SurfaceSource
from illumcli.gonioreflectometer.surface import Surface, height_field, refuse_gaps
from illumcli.mesh_files import is_mesh_file, read_mesh

PICTURES = (".png", ".exr", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr", ".webp", ".pfm")
LARGEST_GRID = 2048
"""Points of a height field along each side."""
SLENDER = 16
"""Length over width of the cells of a formula that does not vary with x or y."""
JUMP = 1e-6
"""Part of the range of heights by which a formula may differ between opposite borders of its tile."""
_AXES = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}


def is_file(text: str) -> bool:
    """True if a surface is a file rather than a formula."""
    path = Path(text)
    return is_mesh_file(path) or path.suffix.lower() in PICTURES


def read_surface(source: SurfaceSource) -> tuple[Surface, list[str]]:
    """The surface, and lines about what is doubtful of it.

    Raises
    ------
    InputError
        It cannot be read or understood.
    LimitError
        It is too large.
    """
    path = Path(source.text)
    if is_mesh_file(path):
        return _of_mesh(path, source)
    if path.suffix.lower() in PICTURES:
        return _of_picture(path, source)
    return _of_formula(source), []


def _of_formula(source: SurfaceSource) -> Surface:
    if source.height is not None:
        raise InputError("--height belongs to pictures; write the height into the formula")
    if Path(source.text).is_file():
        raise InputError(f"{source.text}: is no mesh and no picture that is read; see illum measure --help")
    try:
        formula = parse(source.text, ("x", "y"))
    except ValueError as fault:
        raise InputError(
            f"'{source.text}': {fault}. A surface is a formula of its height in x and y, a mesh or a picture"
        ) from None
    period = (1.0, 1.0) if source.period is None else source.period
    if not min(period) > 0:
        raise InputError("a formula is measured on a tile; give its --period above 0")

    # Sample one tile, the longer side in `grid` steps; coarsely along what it does not vary with.
    columns, rows = (max(2, round(source.grid * side / max(period))) for side in period)
    if "y" not in formula.names:
        rows = max(2, rows // SLENDER)
    if "x" not in formula.names:
        columns = max(2, columns // SLENDER)
    x, y = np.arange(columns) * (period[0] / columns), np.arange(rows) * (period[1] / rows)
    z = formula.value(x[None, :], y[:, None])
    bad = np.argwhere(~np.isfinite(z))
    if len(bad):
        at = f"x = {x[bad[0, 1]]:.4g}, y = {y[bad[0, 0]]:.4g}"
        raise InputError(f"'{source.text}': is no number at {at}; change the formula")

    # The other borders must be at the same height.
    span = max(float(np.ptp(z)), 1e-300)
    jumps = {
        "x": np.abs(formula.value(np.full(rows, period[0]), y) - z[:, 0]).max(),
        "y": np.abs(formula.value(x, np.full(columns, period[1])) - z[0]).max(),
    }
    for axis, (name, jump) in enumerate(jumps.items()):
        if not jump <= JUMP * span + 1e-12:
            raise InputError(
                f"'{source.text}': differs by {jump:.4g} between {name} = 0 and {name} = {period[axis]:.4g}; "
                "give the --period after which it repeats"
            )
    return height_field(z, period)


def _of_picture(path: Path, source: SurfaceSource) -> tuple[Surface, list[str]]:
    from illumcli.images.reader import read_image

    if source.height is None:
        raise InputError(f"{path}: give the --height of white above black, in units of --period")
    if not np.isfinite(source.height):
        raise InputError(f"{path}: --height must be a finite number, is {source.height}")
    image = read_image(path)
    if max(image.width, image.height) > LARGEST_GRID:
        raise LimitError(
            f"{path}: {image.width} x {image.height} pixels, at most {LARGEST_GRID} a side are measured; "
            "make it smaller"
        )
    if min(image.width, image.height) < 2:
        raise InputError(f"{path}: has {image.width} x {image.height} pixels; heights need 2 x 2 at least")
    planes = [plane.astype(np.float64) for name, plane in image.channels.items() if name in ("R", "G", "B")]
    grey = luminance(np.stack(planes, -1)) if len(planes) == 3 else None
    if grey is None:
        grey = next(iter(image.channels.values())).astype(np.float64)
    if not np.isfinite(grey).all():
        raise InputError(f"{path}: has pixels that are NaN or infinite; mend the picture")
    width = 1.0 if source.period is None else source.period[0]
    height = width * image.height / image.width if source.period is None else source.period[1]
    if not min(width, height) > 0:
        raise InputError("a picture is measured as a tile; give its --period above 0")

    # Rows of a picture go down, y up.
    z = grey[::-1] * source.height
    warnings = []
    for axis, name in ((1, "left and right"), (0, "lower and upper")):
        inside = np.abs(np.diff(z, axis=axis))
        jump = np.abs(np.take(z, 0, axis) - np.take(z, -1, axis))
        if np.mean(jump) > 4 * np.mean(inside) + 1e-12:
            warnings.append(
                f"{path}: its {name} borders differ; the seam counts as steep facets. Make it tileable"
            )
    return height_field(z, (width, height)), warnings


def _of_mesh(path: Path, source: SurfaceSource) -> tuple[Surface, list[str]]:
    if source.height is not None:
        raise InputError(f"{path}: --height belongs to pictures; scale the mesh")
    mesh = read_mesh(path)
    triangles = mesh.corners[triangulate(mesh).corners]
    if not len(triangles):
        raise InputError(f"{path}: has no triangles to measure")
    sign = -1.0 if source.up.startswith("-") else 1.0
    vertices = mesh.vertices[:, _AXES[source.up[-1]]].copy()
    if sign < 0:  # half a turn, not a reflection
        vertices[:, 1:] *= -1
    used = np.unique(triangles)
    low, high = vertices[used, :2].min(axis=0), vertices[used, :2].max(axis=0)
    if not (high - low > 0).all():
        raise InputError(f"{path}: has no extent across {source.up}; give the axis that points --up")

    # A tile, or a footprint far from the borders of a single piece.
    is_tile = source.period is not None and min(source.period) > 0
    size = np.array(source.period, np.float64) if is_tile else (high - low) * source.footprint
    corner = low if is_tile else (low + high - size) / 2
    surface = Surface(vertices, triangles.astype(np.int32), corner, size, is_tile)
    if surface.area_vectors[:, 2].sum() < 0:  # inside out
        surface = Surface(vertices, triangles[:, ::-1].astype(np.int32), corner, size, is_tile)
    refuse_gaps(surface, str(path))
    warnings = []
    if not is_tile:
        surface = _mean_at_zero(surface)
        inset = float(((high - low - size) / 2).min())
        warnings.append(
            f"{path}: a single piece, footprint {size[0]:.4g} x {size[1]:.4g} in its middle; what is seen or "
            f"lit lower than {np.degrees(np.arctan2(surface.depth, inset)):.1f} degrees above the plane may "
            "miss what lies beyond its borders"
        )
    return surface, warnings


def _mean_at_zero(surface: Surface) -> Surface:
    """The surface moved along z, so that its mean height over the plane is 0."""
    weights = np.abs(surface.area_vectors[:, 2])
    heights = surface.vertices[surface.triangles, 2].mean(axis=1)
    moved = surface.vertices - [0.0, 0.0, float(np.average(heights, weights=np.maximum(weights, 1e-300)))]
    return Surface(moved, surface.triangles, surface.low, surface.size, surface.is_tile)
