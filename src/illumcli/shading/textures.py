"""Parameters that vary over the surface: textures looked up by uv, and interpolated vertex values.

(0, 0) in uv is the lower left corner of an image and (1, 1) its upper right corner; the centres of the border
texels lie half a texel inside. There are no MIP levels: the samples of a pixel average over its area, so fine
textures need more samples (`film.samples`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, column_major, row_blocks, take_rows
from illumcli.color import Space, Texels
from illumcli.errors import InputError
from illumcli.geometry.repairs import Repair, Repairs, note
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import CurveOverSurface, OverSurface, Texture, VertexValues
from illumcli.rays.corner_weights import CornerWeights, TriangleCorners
from illumcli.rays.interaction import Hits, uv_at
from illumcli.records import Record, Value
from illumcli.schema.annotations import annotation_at, number_range
from illumcli.schema.fields import LARGEST
from illumcli.shading.curves import WIDTHS, curve_at
from illumcli.shading.materials import Materials, colors_at

Floats: TypeAlias = NDArray[np.float32]


def bilinear(image: Texels, uv: Floats, wrap: str) -> Floats:
    """(N, C) bilinear interpolation between the centres of the four texels around each uv.

    Parameters
    ----------
    uv : (N, 2) float32, v upwards
    wrap : {'repeat', 'clamp', 'mirror'}
        Outside of the image: it is repeated, its border is extended, or every other copy is mirrored.
    """
    x, y = _texels(image, uv, wrap)
    left, low = np.floor(x - F(0.5)), np.floor(y - F(0.5))
    right_share, upper_share = (x - F(0.5) - left)[:, None], (y - F(0.5) - low)[:, None]
    x0, x1 = _inside(left, image.width, wrap), _inside(left + 1, image.width, wrap)
    y0, y1 = _inside(low, image.height, wrap), _inside(low + 1, image.height, wrap)
    lower = _mixed(_at(image, y0, x0), _at(image, y0, x1), right_share)
    upper = _mixed(_at(image, y1, x0), _at(image, y1, x1), right_share)
    return _mixed(lower, upper, upper_share)


def nearest(image: Texels, uv: Floats, wrap: str) -> Floats:
    """(N, C) the texel that each uv lies in; parameters as of `bilinear`."""
    x, y = _texels(image, uv, wrap)
    return _at(image, _inside(np.floor(y), image.height, wrap), _inside(np.floor(x), image.width, wrap))


FILTERS: dict[str, Callable[[Texels, Floats, str], Floats]] = {"bilinear": bilinear, "nearest": nearest}


def _texels(image: Texels, uv: Floats, wrap: str) -> tuple[Floats, Floats]:
    """Distance from the left and from the bottom of the image, in texels."""
    if wrap == "clamp":
        inside = np.clip(uv, 0, 1)
    else:
        inside = uv - np.floor(uv)
        if wrap == "mirror":
            inside = np.where(np.floor(uv) % 2 == 1, 1 - inside, inside)
    return inside[:, 0] * F(image.width), inside[:, 1] * F(image.height)


def _inside(number: Floats, count: int, wrap: str) -> NDArray[np.int64]:
    """Column or row numbers wrapped into the image, from numbers at most one outside of it."""
    whole = number.astype(np.int64)
    if wrap != "repeat":  # outside the border of a mirrored image its border texels repeat
        return np.clip(whole, 0, count - 1)
    return whole + count * (whole < 0) - count * (whole >= count)


def _at(image: Texels, y: NDArray[np.int64], x: NDArray[np.int64]) -> Floats:
    """(N, C) texels of columns `x` from the left, rows `y` from the bottom."""
    return image.at((image.height - 1 - y) * image.width + x)


def _mixed(a: Floats, b: Floats, share: Floats) -> Floats:
    """Linear interpolation from `a` at 0 to `b` at 1; exactly `a` where both are equal."""
    return a + share * (b - a)


# --- textures and vertex values, read once per scene -----------------------------------------------------


class Range(Value):
    """Size and range of a parameter."""

    width: int  # 3 for a colour, 1 for a number
    low: float
    high: float


def parameter_range(model: IlluminationModel, path: str) -> Range:
    """Range of the parameter at `path` (`diffuse`, `distribution.m`), from its description."""
    number = number_range(annotation_at(model, path))
    low = (number.gt or 0.0) + float(np.finfo(F).tiny) if number.ge is None else number.ge
    return Range(number.width, low, LARGEST if number.le is None else number.le)


class Attribute(Record):
    """Values at the scene's vertices that a parameter is interpolated from, clipped to its range."""

    values: Floats  # (V, C)
    within: Range
    factor: Floats | None = None  # (C,) multiplies the values; None for 1


class Map(Record):
    """An image that a parameter is looked up in, clipped to the parameter's range."""

    image: Texels
    filter: str
    wrap: str
    within: Range
    factor: Floats | None = None  # (C,)
    vertex: Floats | None = None  # (V, C) values at all stored vertices that multiply the texels, too
    uv: Floats | None = None  # (V, 2) texture coordinates that replace those of the meshes


class Curved(Record):
    """A curve with maps that a parameter is computed from."""

    curve: CurveOverSurface
    maps: Mapping[str, Map | Attribute]
    within: Range


Source: TypeAlias = Map | Attribute | Curved


class Varying(Record):
    """The textures, vertex values and curves of all materials."""

    of_material: tuple[Mapping[str, Source], ...] = ()  # by material number, by path
    repairs: Repairs = field(default_factory=dict)


def paths(model: IlluminationModel, purpose: str) -> dict[str, OverSurface]:
    """The varying parameters that are needed for a purpose: `lobes`, `ambient` or `emission`."""
    of_lobes = model.varying()
    others = {name: of_lobes.pop(name) for name in ("emission", "ambient") if name in of_lobes}
    if purpose == "lobes":
        return of_lobes if model.lobes() else {}
    if purpose == "ambient" and model.ambient is None:
        return of_lobes if model.diffuse_color() != (0.0, 0.0, 0.0) else {}
    return {purpose: others[purpose]} if purpose in others else {}


def textures(
    object_names: Sequence[str],
    read: Callable[[str, Space], Texels],
    purpose: str,
    geometry: SceneGeometry,
    materials: Materials,
) -> Varying:
    """The textures and vertex values of all materials in use, checked against the meshes and clipped.

    Parameters
    ----------
    read : callable
        Path and colour space of a texture -> its linear image. Without a colour space the type of the
        pixels decides.

    Raises
    ------
    InputError
        Unreadable images, and attributes or uv that a mesh does not have; all of them in one error.
    """
    used_by = _objects_of(geometry, materials)
    problems: list[str] = []
    repairs: dict[str, Repair] = {}

    def source(number: int, path: str, value: OverSurface) -> Source:
        """The data of one parameter."""
        within = parameter_range(materials.models[number], path)
        where = f"material {materials.names[number]}: {path}"
        if not isinstance(value, CurveOverSurface):
            return lookup(number, value, within, where)
        maps = {}
        for name, each in value.maps():
            any_number = Range(min(WIDTHS[name], within.width), -LARGEST, LARGEST)
            maps[name] = lookup(number, each, any_number, f"{where}.{name}")
        curved = Curved(value, maps, within)
        outside = _outside(curved, _vertices_of(geometry, used_by[number]), where)
        _note_clipped(outside, within, f"values beyond {where}", repairs)
        return curved

    def lookup(number: int, value: Texture | VertexValues, within: Range, where: str) -> Map | Attribute:
        """The data of one texture or of vertex values."""
        lacking = [_lacks(geometry, value, i, object_names[i], where, within.width) for i in used_by[number]]
        if any(lacking):
            raise InputError(filter(None, lacking))
        factor = None if value.factor == (1.0, 1.0, 1.0) else np.array(value.factor, F)[: within.width]
        table, uv = (
            None if name is None else _table(geometry, name, used_by[number], width)
            for name, width in ((value.vertex, within.width), (getattr(value, "uv", None), 2))
        )
        if table is not None:
            table = _clipped(table, within, f"vertex values beyond {where}", repairs)
        if isinstance(value, VertexValues):
            assert table is not None
            return Attribute(table, within, factor)
        whole = read(value.texture, value.space)
        channels = _channels(len(whole.channels), value, within.width, where)
        image, outside = whole.select(channels).clipped(within.low, within.high)
        _note_clipped(outside, within, f"texels beyond {where}", repairs)
        return Map(image, value.filter, value.wrap, within, factor, table, uv)

    # Read those of each material in turn; faults of the scene's own materials are reported together.
    of_material: list[dict[str, Source]] = []
    for number, model in enumerate(materials.models):
        sources: dict[str, Source] = {}
        for path, value in (paths(model, purpose) if used_by[number] else {}).items():
            try:
                sources[path] = source(number, path, value)
            except InputError as error:
                substitute = materials.substitute(number, path)
                if substitute is None:
                    problems.extend(error.problems)
                else:  # a material of a mesh file: use its substitute and note it as a repair
                    note(
                        repairs,
                        f"textures that cannot be used left out ({error.problems[0]})",
                        substitute.first,
                    )
                    sources[path] = _uniform(substitute.value, parameter_range(model, path))
        of_material.append(sources)
    if problems:
        raise InputError(dict.fromkeys(problems))
    return Varying(tuple(of_material), repairs)


def _uniform(value: Sequence[float], within: Range) -> Map:
    """A texture of one texel."""
    texel = np.clip(np.asarray(value[: within.width], F), F(within.low), F(within.high))
    image = Texels(texel.reshape(1, 1, -1), tuple(range(within.width)))
    return Map(image, "nearest", "repeat", within)


def _objects_of(geometry: SceneGeometry, materials: Materials) -> list[list[int]]:
    """By material number, the numbers of the objects with polygons that have it."""
    numbering = materials.numbering
    starts = [*(placed.first_triangle for placed in geometry.placed), len(geometry.triangles)]
    objects: list[list[int]] = [[] for _ in materials.models]
    for i, which in enumerate(geometry.placed_mesh.tolist()):
        if starts[which] == starts[which + 1]:
            continue
        number = int(numbering.of_object[i])
        own = slice(*(numbering.first[i] + starts[which : which + 2]))
        for each in [number] if number >= 0 else np.flatnonzero(np.bincount(numbering.of_triangle[own])):
            objects[each].append(i)
    return objects


def _lacks(
    geometry: SceneGeometry, value: Texture | VertexValues, i: int, name: str, where: str, width: int
) -> str | None:
    """The error message if object number `i` lacks the uv or vertex attribute that `value` needs."""
    # A texture needs uv.
    mesh = geometry.placed[geometry.placed_mesh[i]].mesh
    if isinstance(value, Texture) and value.uv is None and (mesh.uvs is None or mesh.corner_uvs is None):
        return (
            f"object {name}: {where} is a texture and the mesh has no uv; export it with uv, or give a value"
        )

    # Vertex attributes need the right number of components.
    kind = "is a colour" if width == 3 else "is a number"
    for attribute, wants, numbers in (
        (value.vertex, kind, {1, width}),
        (getattr(value, "uv", None), "wants uv", {2}),
    ):
        if attribute is None:
            continue
        if attribute not in mesh.attributes:
            known = ", ".join(sorted(mesh.attributes)) or "none"
            return f"object {name}: {where} wants the vertex attribute '{attribute}'; the mesh has: {known}"
        size = mesh.attributes[attribute][:1].size
        if size not in numbers and not 1 < max(numbers) < size:
            return (
                f"object {name}: {where} {wants} and the vertex attribute '{attribute}' has {size} "
                "numbers per vertex; name another"
            )
    return None


def _vertices_of(geometry: SceneGeometry, objects: Sequence[int]) -> Ids:
    """Numbers of the stored vertices of these objects."""
    placed = [geometry.placed[which] for which in {int(geometry.placed_mesh[i]) for i in objects}]
    parts = [each.first_vertex + np.arange(len(each.mesh.vertices), dtype=np.int32) for each in placed]
    return np.concatenate(parts)


def _table(geometry: SceneGeometry, attribute: str, objects: Sequence[int], width: int) -> Floats:
    """(V, C) an attribute of these objects at all stored vertices; 0 at the vertices of others."""
    out = np.zeros((len(geometry.vertices), width), F)
    for i in {int(geometry.placed_mesh[i]): i for i in objects}.values():
        placed = geometry.placed[geometry.placed_mesh[i]]
        values = placed.mesh.attributes[attribute].reshape(len(placed.mesh.vertices), -1)
        out[placed.first_vertex : placed.first_vertex + len(values)] = values[:, :width]
    return out


def _channels(count: int, texture: Texture, width: int, where: str) -> tuple[int, ...]:
    """The channels of an image that a colour or number is read from; grey is three equal channels."""
    if width == 3:
        return (0, 1, 2) if count >= 3 else (0, 0, 0)
    number = "rgba".index(texture.channel)
    if texture.channel == "a" and count in (2, 4):
        number = count - 1
    elif count <= 2 and number < 3:  # grey, with or without alpha
        number = 0
    elif number >= count:
        raise InputError(f"{where}: {texture.texture} has no channel '{texture.channel}'; choose r, g or b")
    return (number,)


def _clipped(values: Floats, within: Range, what: str, repairs: dict[str, Repair]) -> Floats:
    """`values` clipped to the range; `repairs` notes how many were outside."""
    outside = int(np.count_nonzero((values < F(within.low)) | (values > F(within.high))))
    _note_clipped(outside, within, what, repairs)
    return np.clip(values, F(within.low), F(within.high)) if outside else values


def _note_clipped(outside: int, within: Range, what: str, repairs: dict[str, Repair]) -> None:
    if outside:
        note(repairs, f"{what} clipped to {within.low:g}..{within.high:g}", count=outside)


def _outside(curved: Curved, vertices: Ids, where: str) -> int:
    """How many values of a curve are out of range: at the texels of its largest texture, or at the vertices
    if it has none. Of vertex values beside textures, the smallest and the largest count.

    Raises
    ------
    InputError
        A value is not finite.
    """
    textures = {name: each for name, each in curved.maps.items() if isinstance(each, Map)}
    of_vertices = {
        name: _times(each.values.take(vertices, axis=0), each.factor)
        for name, each in curved.maps.items()
        if isinstance(each, Attribute)
    }
    if not textures:
        return int(np.count_nonzero(_is_outside(curved, of_vertices, where)))

    # Texel by texel, with all combinations of the extremes of vertex values.
    image = max((each.image for each in textures.values()), key=lambda each: each.height * each.width)
    extremes = [(values.min(axis=0), values.max(axis=0)) for values in of_vertices.values()]
    count = 0
    for block in row_blocks(image.height * image.width):
        uv = _texel_centres(image, np.arange(block.start, block.stop))
        at_texels = {
            name: _times(FILTERS[each.filter](each.image, uv, each.wrap), each.factor)
            for name, each in textures.items()
        }
        outside: Any = False
        for row in product(*extremes):
            ends = {name: np.tile(end, (len(uv), 1)) for name, end in zip(of_vertices, row, strict=True)}
            outside = outside | _is_outside(curved, at_texels | ends, where)
        count += int(np.count_nonzero(outside))
    return count


def _is_outside(curved: Curved, maps: Mapping[str, Floats], where: str) -> NDArray[np.bool_]:
    """(N, C) is each value of a curve out of range, by the values of its maps?"""
    values = curve_at(curved.curve, maps, curved.within.width)
    if not np.isfinite(values).all():
        raise InputError(f"{where}: its formula is not finite at some points; mind its domain")
    return (values < curved.within.low) | (values > curved.within.high)


def _texel_centres(image: Texels, number: NDArray[np.int64]) -> Floats:
    """(N, 2) uv of the centres of texels, numbered row by row."""
    v, u = np.divmod(number, image.width)
    return np.stack([(u + 0.5) / image.width, (v + 0.5) / image.height], axis=1).astype(F)


def _times(values: Floats, factor: Floats | None) -> Floats:
    return values if factor is None else values * factor


# --- at points ------------------------------------------------------------------------------------------


class Parameters(Record):
    """Values of the varying parameters at E points; each is 0 at points of other materials."""

    of_material: tuple[tuple[tuple[str, int], ...], ...]  # by number: path and width of each that varies
    values: Mapping[tuple[str, int], Floats]  # (E,) numbers or (E, 3) colours

    def model(self, model: IlluminationModel, number: int, index: Ids | slice) -> IlluminationModel:
        """The model of material `number` with its parameters at these points."""
        names = self.of_material[number]
        if not names:
            return model
        at_points = {
            path: self.values[path, width][index]
            if isinstance(index, slice)
            else take_rows(self.values[path, width], index)
            for path, width in names
        }
        return model.at(at_points)


def parameters(
    geometry: SceneGeometry,
    textures: Varying,
    material: Ids,
    point_weights: CornerWeights,
    uvs: CornerVectors | None,
) -> Parameters:
    """Every varying parameter at points on triangles.

    Parameters
    ----------
    material : (E,) int32
        Material number of each point.
    point_weights : CornerWeights
        The weights of the corners around each of the E points.
    """
    names: list[tuple[tuple[str, int], ...]] = []
    values: dict[tuple[str, int], Floats] = {}
    for number, sources in enumerate(textures.of_material):
        # The points of this material.
        names.append(tuple((path, source.within.width) for path, source in sources.items()))
        index = np.flatnonzero(material == number).astype(np.int32) if sources else np.zeros(0, np.int32)
        if not index.size:
            continue
        weights = point_weights.take(index)
        lookup = _Lookup(geometry, weights, uvs)
        for path, source in sources.items():
            # Look it up, clip what rounding or a curve took out of range, and store at the material's points.
            if isinstance(source, Curved):
                maps = {name: lookup.of(each) for name, each in source.maps.items()}
                value = curve_at(source.curve, maps, source.within.width).astype(F)
            else:
                value = lookup.of(source)
            key = path, source.within.width
            at_all = values.setdefault(key, np.zeros((len(material), source.within.width), F, order="F"))
            at_all[index] = np.clip(value, F(source.within.low), F(source.within.high))
    return Parameters(
        tuple(names),
        {key: at_all[:, 0] if key[1] == 1 else column_major(at_all) for key, at_all in values.items()},
    )


class _Lookup:
    """Looks textures and vertex values up at points; the uv of the meshes are computed once."""

    def __init__(self, geometry: SceneGeometry, weights: CornerWeights, uvs: CornerVectors | None) -> None:
        self._geometry, self._weights, self._uvs = geometry, weights, uvs
        self._mesh_uv: Floats | None = None

    def of(self, source: Map | Attribute) -> Floats:
        """(N, C) values at the points, times the factor."""
        if isinstance(source, Attribute):
            value = self._at_vertices(source.values)
        else:
            uv = self._uv() if source.uv is None else self._at_vertices(source.uv)
            value = FILTERS[source.filter](source.image, uv, source.wrap)
            if source.vertex is not None:
                value = value * self._at_vertices(source.vertex)
        return _times(value, source.factor)

    def _at_vertices(self, table: Floats) -> Floats:
        return self._weights.interpolate_vertices(self._geometry, table)

    def _uv(self) -> Floats:
        if self._mesh_uv is None:
            assert self._uvs is not None
            self._mesh_uv = uv_at(self._geometry, self._uvs, self._weights)
        return self._mesh_uv


def texel_positions(
    geometry: SceneGeometry, uvs: CornerVectors, hits: Hits, material: Ids, varying: Sequence[Varying]
) -> Floats:
    """(M, 2) place of every hit in the largest texture of its material [texels]; 0 where it has none.

    Parameters
    ----------
    material : (M,) int32
        Material number of each hit.
    varying : sequence of Varying
        The textures and vertex values of the materials.
    """
    out = np.zeros((len(material), 2), F, order="F")
    for number in range(max((len(each.of_material) for each in varying), default=0)):
        sources = [each for part in varying for each in part.of_material[number].values()]
        sources = [
            each
            for source in sources
            for each in (source.maps.values() if isinstance(source, Curved) else (source,))
        ]
        maps = [each for each in sources if isinstance(each, Map)]
        at = np.flatnonzero(material == number) if maps else np.zeros(0, np.int64)
        if not at.size:
            continue
        largest = max(maps, key=lambda each: each.image.height * each.image.width)
        all_hits = TriangleCorners(None, hits.objects, hits.triangle, hits.u, hits.v)
        corners = all_hits.at(at, None)
        if largest.uv is None:
            place = uv_at(geometry, uvs, CornerWeights(corners, (corners,)))
        else:
            place = CornerWeights(corners, (corners,)).interpolate_vertices(geometry, largest.uv)
        out[at] = place * np.array([largest.image.width, largest.image.height], F)
    return out


class PointMaterials(Record):
    """The material of each of E points."""

    materials: Materials
    number: Ids  # (E,)
    parameters: Parameters | None = None
    """The parameters that vary over the surface; None if none does."""

    def colors(self, color: Callable[[IlluminationModel], Any]) -> Vectors:
        """(E, 3) float32 a colour of each point's material, computed from its varying parameters there."""
        models, parameters = self.materials.models, self.parameters
        out = colors_at([color(model) for model in models], self.number)
        for number, model in enumerate(models if parameters is not None else ()):
            if parameters is not None and parameters.of_material[number]:
                index = np.flatnonzero(self.number == number).astype(np.int32)
                if index.size:
                    out[index] = color(parameters.model(model, number, index))
        return out
