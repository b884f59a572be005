"""The description of a scene: frozen pydantic models, without arrays or open files.

The JSON schema in ``schemas/scene.schema.json`` is generated from this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationError,
    field_validator,
    model_validator,
)

from illumcli.geometry.shapes import AnyShape, Shape
from illumcli.layers import NAMES
from illumcli.lights import AnyLight
from illumcli.models import AnyModel
from illumcli.scene.frames import Frames
from illumcli.scene.references import reference_faults
from illumcli.schema.description import DEFAULTS, Description, default_of
from illumcli.schema.fields import (
    COLOR,
    Color,
    Direction,
    ListOf,
    Name,
    NonNegative,
    Number,
    Positive,
    Share,
    Shorthand,
    Vector,
    spread,
)
from illumcli.schema.messages import describe
from illumcli.shading.rates import RATES
from illumcli.visibility.falloffs import AnyFalloff
from illumcli.visibility.samplers import SAMPLERS

Count: TypeAlias = Annotated[int, Field(ge=1, le=2**31 - 1)]
Seed: TypeAlias = Annotated[int, Field(ge=0, le=2**32 - 1)]
Row: TypeAlias = Annotated[tuple[Number, Number, Number, Number], Strict(False)]
Matrix: TypeAlias = Annotated[tuple[Row, Row, Row, Row], Strict(False)]

# Names from tables, whose rows document them.
if TYPE_CHECKING:
    Layer: TypeAlias = str
    Rate: TypeAlias = str
    Sampler: TypeAlias = str
else:
    Layer = Literal[NAMES]
    Rate = Literal[tuple(RATES)]
    Sampler = Literal[tuple(SAMPLERS)]


class Normals(Description):
    """The normals of a mesh that shading interpolates."""

    source: Literal["file", "computed"] = "file"
    """`file`: the file's normals where it has them, computed ones elsewhere. `computed`: computed from the
    polygons, even if the file has normals."""
    weights: Literal["angle", "area", "equal"] = "angle"
    """Weight of a polygon in a vertex normal. `angle`: its angle at the vertex, so that the normal does not
    depend on how faces are split into polygons. `area`: its area. `equal`: the same for all."""
    crease: Annotated[float, Field(ge=0, le=180)] | None = None
    """Edges whose polygons meet at a larger angle than this are sharp [degrees]; 180: none. By default the
    file's smoothing groups decide, and 40 degrees if it has none."""
    polygon: Literal["newell", "cross", "edge_average", "plane"] = "newell"
    """How a polygon's normal is computed. `newell`: by Newell's sum over all corners, which suits every
    polygon. `cross`: from the edges at the first corner. `edge_average`: as the mean over all corners of the
    edges' cross products. `plane`: of the plane through the first three corners."""


class MeshFile(Description):
    """A mesh read from a file; the suffix is the format."""

    file: str
    """Path, from the scene's folder."""
    normals: Normals = DEFAULTS
    """Where the normals that shading interpolates come from."""
    materials: bool = False
    """True: import the materials of the file."""
    obscurance: str | None = None
    """Path of a file with the obscurance of this mesh, which casts no obscurance rays then: an .npz, .ply,
    .glb or .obj that `illum ao-bake` wrote for it, or an image over its uv, whose red channel is read. The
    mesh's own file may be named, too. Occlusion textures of glTF count if vertices have no obscurance, or if
    the same bake wrote both."""


def _mesh_kind(value: Any) -> str:
    """A mesh is read from a file unless it names a shape."""
    is_shape = "shape" in value if isinstance(value, dict) else isinstance(value, Shape)
    return "shape" if is_shape else "file"


MeshSource: TypeAlias = Annotated[
    Annotated[MeshFile, Tag("file")] | Annotated[AnyShape, Tag("shape")], Discriminator(_mesh_kind)
]


class Transform(Description):
    """Transform of an object: scale, rotate, fit and translate, in this order, then the matrix."""

    scale: Annotated[Vector, Shorthand(spread)] = (1.0, 1.0, 1.0)
    """One factor, or one per axis; negative ones mirror."""
    rotate: Vector = (0.0, 0.0, 0.0)
    """About x, then y, then z [degrees]."""
    fit: Positive | None = None
    """Scale and move the rotated object so that half the diagonal of its bounding box has this length and the
    box stands on y = 0, centred on the y axis [scene units]."""
    translate: Vector = (0.0, 0.0, 0.0)
    """Translation along x, y and z [scene units]."""
    matrix: Matrix | None = None
    """Four rows, applied last to column vectors; the last one is 0 0 0 1."""

    @field_validator("matrix")
    @classmethod
    def _is_affine(cls, matrix: Matrix | None) -> Matrix | None:
        if matrix is not None and matrix[3] != (0, 0, 0, 1):
            last = ", ".join(f"{value:g}" for value in matrix[3])
            raise ValueError(
                f"the last of its four rows must be 0, 0, 0, 1, is {last}; where its numbers stand column by "
                "column, write it transposed"
            )
        return matrix


class Grain(Description):
    """Grain in circles about an axis, as on a turned or brushed disc."""

    axis: Direction = (0.0, 1.0, 0.0)
    """Direction of the axis, in object space."""
    centre: Vector = (0.0, 0.0, 0.0)
    """A point on the axis, in object space, before the transform."""


NameOrMesh: TypeAlias = Annotated[
    Annotated[str, Tag("name")] | Annotated[MeshSource, Tag("mesh")],
    Discriminator(lambda value: "name" if isinstance(value, str) else "mesh"),
]
NameOrMaterial: TypeAlias = Annotated[
    Annotated[str, Tag("name")] | Annotated[AnyModel, Tag("material")],
    Discriminator(lambda value: "name" if isinstance(value, str) else "material"),
]
AnyGrain: TypeAlias = Annotated[
    Annotated[Direction, Tag("direction")] | Annotated[Grain, Tag("radial")],
    Discriminator(lambda value: "radial" if isinstance(value, dict | Grain) else "direction"),
]


class Object(Description):
    """A mesh with a material and a transform."""

    mesh: NameOrMesh
    """The name of a mesh, the path of a mesh file, or a mesh described in place."""
    name: Name | None = None
    """Name of the object in messages, overrides and files; by default `object1` and so on."""
    material: NameOrMaterial | None = None
    """The name of a material, or one described in place. By default the scene's materials that the mesh file
    selects by name, and light grey Lambert for polygons without one."""
    fallback: NameOrMaterial | None = None
    """If no `material` is given: use the materials, textures and vertex colours of the mesh file, even if the
    scene has materials of the same names, and this material, by name or in place, for polygons without one.
    Intensities of MTL are then taken as reflectances, and the diffuse colour reflects ambient light."""
    override: dict[str, Any] = DEFAULTS
    """Parameters of the material that differ on this object."""
    transform: Transform = DEFAULTS
    """Position, orientation and size."""
    shading: Rate | None = None
    """How often its material is evaluated; by default the scene's rate."""
    grain: AnyGrain | None = None
    """Tangent of anisotropic materials: a direction, or circles about an axis; by default increasing u."""


class _Camera(Description):
    position: Vector = (1.8, 1.9, 3.6)
    """Position of the eye [scene units]; the default suits an object fitted to radius 1."""
    target: Vector = (0.0, 0.75, 0.0)
    """The point in the middle of the image [scene units]."""
    up: Direction = (0.0, 1.0, 0.0)
    """Any vector that is not along the line of sight; if it is, another axis is used."""
    fit: Name | None = None
    """Name of an object that fills the image: the camera keeps its direction and moves until all of the
    object is visible; an orthographic camera also sets its extent."""
    width: Count | None = None
    """Width of its image [pixels]; by default the film's."""
    height: Count | None = None
    """Height of its image [pixels]; by default the film's."""
    samples: Count | None = None
    """Samples per pixel; by default the film's."""

    @model_validator(mode="after")
    def _has_a_line_of_sight(self) -> Self:
        if self.position == self.target:
            raise ValueError("position and target must differ")
        return self


class Perspective(_Camera):
    """A pinhole camera."""

    projection: Literal["perspective"] = "perspective"
    fov: Annotated[float, Field(gt=0, lt=180)] = 35.0
    """Vertical field of view [degrees]."""


class Orthographic(_Camera):
    """Parallel rays."""

    projection: Literal["orthographic"]
    extent: Positive = 2.0
    """Height of the view [scene units]."""


Camera: TypeAlias = Annotated[
    Annotated[Perspective, Tag("perspective")] | Annotated[Orthographic, Tag("orthographic")],
    Discriminator(
        lambda value: (
            value.get("projection", "perspective")
            if isinstance(value, dict)
            else getattr(value, "projection", "perspective")
        ),
        custom_error_type="unknown_projection",
        custom_error_message="no such projection; there are: perspective, orthographic",
    ),
]


class Filter(Description):
    """The pixel filter, by importance sampling: sample positions are drawn from it, and pixels share none."""

    filter: Literal["box", "tent", "gaussian"] = "box"
    """`box`: uniform over the pixel. `tent`: weight falls linearly with the distance from the pixel's centre.
    `gaussian`: a bell curve, the softest."""
    width: Positive = 1.0
    """Support of box and tent, and two standard deviations of the Gaussian, either side [half pixels]."""


DIFFERENCE = 0.02


class Adaptive(Description):
    """Adaptive sampling: one sample at the centre of every pixel, and all of them only where one is not
    enough: at the edges of objects, where normal, depth or light change abruptly, where textures are finer
    than pixels.

    It is biased: features between the samples that are tested, such as the shadow of a wire, are missed.
    """

    probes: Count | None = None
    """Samples of every pixel whose first hits are tested; by default a quarter of them, but at least 2."""
    difference: Annotated[float, Field(gt=0, le=1)] = DIFFERENCE
    """Greatest second difference of light over three pixels, as a share of the brightest around."""


def _adaptive(value: Any) -> Any:
    """`true` is a mapping without keys, a number its `probes`; scenes of 0.1.0 call these `first`."""
    if value is True:
        return {}
    if isinstance(value, int) and value is not False:
        return {"probes": value}
    if isinstance(value, Mapping) and "first" in value and "probes" not in value:
        return {"probes" if key == "first" else key: each for key, each in value.items()}
    return value


AdaptiveOrNot: TypeAlias = Annotated[
    Annotated[Literal[False], Tag("off")] | Annotated[Adaptive, Tag("on")],
    Discriminator(lambda value: "off" if value is False else "on"),
]


class Film(Description):
    """Size and sampling of the image."""

    width: Count = 1280
    """Width of the image [pixels]."""
    height: Count = 720
    """Height of the image [pixels]."""
    samples: Count = 4
    """Samples per pixel; a single one is at the pixel's centre."""
    adaptive: (
        Annotated[AdaptiveOrNot, BeforeValidator(_adaptive, json_schema_input_type=Adaptive | bool | Count)]
        | None
    ) = None
    """Adaptive sampling: all samples only where one is not enough; `true`, the settings of the test for it,
    or its number of probes. `false`: every pixel has all samples. By default `true` for 8 samples or more,
    for 2 or more if obscurance is reconstructed."""
    filter: Filter = DEFAULTS
    """The pixel filter."""
    background: Color | None = None
    """Radiance behind all objects; by default none, with alpha 0."""
    exposure: Annotated[float, Field(ge=-64, le=64)] = 0.0
    """Exposure of 8-bit images [stops]; EXR files hold radiance without it."""


def _ambient(value: Any) -> Any:
    if value in FORMS:
        return {"form": value, "color": 1.0}
    if isinstance(value, str) and not value.startswith("#"):
        raise ValueError(f"must be {COLOR}, or a form (separate, coupled), is {describe(value)}")
    return {"color": value} if isinstance(value, str | int | float | list | tuple) else value


FORMS = ("separate", "coupled")


class Ambient(Description):
    """I_a, light from all directions, multiplied by obscurance."""

    color: Color = (0.0, 0.0, 0.0)
    """I_a; black is none."""
    form: Literal["separate", "coupled"] = "separate"
    """`separate`: k_a I_a w + direct. `coupled`: (k_a I_a + direct) w + I_d, as printed by Theoharis et al.
    (2008), eq. 12.75, where I_d is the irradiance of the lights; it counts direct light twice."""


AmbientText: TypeAlias = Ambient | Color | Literal["separate", "coupled"]  # how a scene may write it


class DepthCue(Description):
    """Depth cueing: distant surfaces fade into a colour, whatever their material and light.

    L' = (1 - a) L + a color,  a = strength * (distance - near) / (far - near), clamped to 0..strength

    After Warnock (1969), A hidden surface algorithm for computer generated halftone pictures, University of
    Utah, where intensity falls with the distance from the eye. Not physical; it shows the order in depth.
    """

    near: NonNegative
    """Distance from the eye at which fading begins [scene units]."""
    far: Positive
    """Distance from the eye at which fading ends [scene units]."""
    strength: Share = 1.0
    """Share of the colour at `far` and beyond."""
    color: Color = (0.0, 0.0, 0.0)
    """The colour that surfaces fade into: black, or that of the background, as in haze."""

    @model_validator(mode="after")
    def _fades_somewhere(self) -> Self:
        if self.near >= self.far:
            raise ValueError(f"near must be below far, is {self.near:g} with far {self.far:g}")
        return self


class Obscurance(Description):
    """w(p) by Monte Carlo: the share of ambient light that reaches each point."""

    samples: Annotated[int, Field(ge=1, le=65536)] = 64
    """Rays per pixel sample."""
    falloff: AnyFalloff = default_of({"falloff": "step"})
    """Weight of occluders by distance; by default every occluder counts fully: ambient occlusion."""
    sampler: Sampler = "spiral"
    """The point set of ray directions."""
    faces: Literal["count", "ignore", "one_sided"] = "count"
    """How back faces are treated. `count`: they occlude like front faces. `ignore`: rays pass through them.
    `one_sided`: they end the ray, unoccluded."""
    about: Literal["shading", "geometric"] = "shading"
    """Axis of the hemisphere. `shading`: the interpolated normal that direct light is shaded with; directions
    that point below the polygon are mirrored at its plane. `geometric`: the polygon's normal."""
    reconstruct: bool | None = None
    """True: fit w to the surface around each pixel, object by object, which takes a tenth of the rays for the
    same error. By default only where `--target-error` chooses the rays."""


class Outputs(Description):
    """Layers and files of a render."""

    layers: Annotated[ListOf[Layer], Field(min_length=1)] = ("beauty",)
    """The layers that are rendered."""
    files: Annotated[ListOf[str], Field(min_length=1)] = ("{scene}.{camera}.png",)
    """Name patterns, relative to the current folder. `.exr` has all layers in one file. `.png` has one file
    per layer (`{layer}` in its name if there are several), with light as sRGB and data as plain numbers; the
    file's metadata tell how to read them."""
    colour: Literal["half", "float"] = "half"
    """Precision of colours in EXR; depth, positions, normals and ids always have 32 bits. `half`: 16 bits, up
    to 65504. `float`: 32 bits."""


class Scene(Description):
    """The content of a scene file."""

    version: Literal[1]
    """Version of the scene format."""
    camera: Camera | None = None
    """A single camera, named `main`."""
    cameras: dict[Name, Camera] = DEFAULTS
    """Several cameras by name, instead of `camera`."""
    frames: Frames | None = None
    """The frames of an animation: any value of the scene may then be a curve; by default a single picture."""
    film: Film = DEFAULTS
    """Size and sampling of the image."""
    shading: Rate = "phong"
    """The shading rate: how often models are evaluated."""
    terminator: Literal["smooth", "none"] = "smooth"
    """The shadow terminator of smooth shading. `smooth`: shadow rays start on the surface that the normals
    imply, so that coarse polygons cast no shadow on its lit side. `none`: they start on the polygons."""
    ambient: Annotated[Ambient, BeforeValidator(_ambient, json_schema_input_type=AmbientText)] = DEFAULTS
    """Colour, form or both of ambient light. `separate`: it is added to the direct light. `coupled`: both are
    multiplied by obscurance, as printed by Theoharis et al. (2008)."""
    obscurance: Obscurance | None = None
    """Obscurance of ambient light by nearby surfaces; by default w = 1 and no rays are cast."""
    depth_cue: DepthCue | None = None
    """Fade the beauty with the distance from the eye; by default it does not fade."""
    meshes: dict[Name, MeshSource] = DEFAULTS
    """Files and shapes by name, for objects to share."""
    materials: dict[Name, AnyModel] = DEFAULTS
    """Illumination models with their parameters by name, for objects and mesh files to select."""
    objects: ListOf[Object] = ()
    """Meshes with their materials and transforms."""
    lights: ListOf[AnyLight] = ()
    """The lights; without any there is only ambient light."""
    outputs: Outputs = DEFAULTS
    """Layers and files that are written."""
    seed: Seed = 0
    """Seed of all random numbers: the same seed gives the same image."""

    @model_validator(mode="after")
    def _names_lead_somewhere(self) -> Self:
        if faults := list(reference_faults(self)):
            raise ValidationError.from_exception_data(
                "Scene",
                [
                    {"type": "value_error", "loc": path, "input": None, "ctx": {"error": ValueError(fact)}}
                    for path, fact in faults
                ],
            )
        return self

    def material_of(self, thing: Object) -> AnyModel | None:
        """The object's material with its overrides; None if the mesh selects materials."""
        material = thing.material
        model = self.materials[material] if isinstance(material, str) else material
        if not thing.override:
            return model
        base = model or self.fallback_of(thing) or default_material()
        return type(base).model_validate({**dict(base), **thing.override})

    def fallback_of(self, thing: Object) -> AnyModel | None:
        """The object's fallback; None if it has a material or no fallback."""
        fallback = thing.fallback
        if thing.material is not None:
            return None
        return self.materials[fallback] if isinstance(fallback, str) else fallback

    def named_cameras(self) -> dict[str, Perspective | Orthographic]:
        """The cameras by name, at least one."""
        return self.cameras or {"main": self.camera or Perspective()}

    def film_of(self, camera: str) -> tuple[int, int, int]:
        """Width, height [pixels] and samples per pixel of a camera's picture: its own, or those of `film`."""
        own, film = self.named_cameras()[camera], self.film
        return own.width or film.width, own.height or film.height, own.samples or film.samples

    def named_lights(self) -> dict[str, AnyLight]:
        """The lights by name: their own, or their type and number."""
        return {l.name or f"{dict(l)['light']}{i + 1}": l for i, l in enumerate(self.lights)}

    def object_names(self) -> tuple[str, ...]:
        return tuple(o.name or f"object{i + 1}" for i, o in enumerate(self.objects))


@cache
def default_material() -> AnyModel:
    """The material of polygons without one: light grey Lambert."""
    from illumcli.models.lambert import Lambert

    return Lambert()
