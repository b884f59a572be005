"""A scene as data: frozen descriptions, no arrays, no files opened.

The JSON schema in ``schemas/scene.schema.json`` is made from this module.
"""

from __future__ import annotations

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
Row: TypeAlias = Annotated[tuple[Number, Number, Number, Number], Strict(False)]
Matrix: TypeAlias = Annotated[tuple[Row, Row, Row, Row], Strict(False)]

# names of tables, whose rows say what each means
if TYPE_CHECKING:
    Layer: TypeAlias = str
    Rate: TypeAlias = str
    Sampler: TypeAlias = str
else:
    Layer = Literal[NAMES]
    Rate = Literal[tuple(RATES)]
    Sampler = Literal[tuple(SAMPLERS)]


class Normals(Description):
    """How a mesh gets the normals that shading interpolates."""

    source: Literal["file", "computed"] = "file"
    """`file`: the file's own where it has them, computed ones elsewhere. `computed`: made from the polygons,
    whatever the file has."""
    weights: Literal["angle", "area", "equal"] = "angle"
    """What each polygon counts for in a vertex normal. `angle`: its angle at the vertex, so that it does not
    matter how faces are cut into polygons. `area`: its area. `equal`: as much as any other."""
    crease: Annotated[float, Field(ge=0, le=180)] | None = None
    """Polygons that meet at more than this keep their edge sharp [degrees]; 180: none. By default the file's
    smoothing groups say so, and 40 degrees where it has none."""
    polygon: Literal["newell", "cross", "edge_average", "plane"] = "newell"
    """How a polygon's own normal is found. `newell`: by Newell's sum over all corners, which suits every
    polygon. `cross`: by the edges at the first corner. `edge_average`: as the mean over all corners of the
    edges' cross products. `plane`: of the plane through the first three corners."""


class MeshFile(Description):
    """A mesh read from a file; its suffix says the format."""

    file: str
    """Path, from the scene's folder."""
    normals: Normals = DEFAULTS
    """Where the normals that shading interpolates come from."""
    materials: bool = False
    """True: import the materials that the file's own library describes."""
    obscurance: str | None = None
    """Path of values that `illum ao-bake` wrote for this mesh as .npz: no obscurance ray is cast for it."""


def _mesh_kind(value: Any) -> str:
    """A mesh is read from a file unless it names a shape."""
    is_shape = "shape" in value if isinstance(value, dict) else isinstance(value, Shape)
    return "shape" if is_shape else "file"


MeshSource: TypeAlias = Annotated[
    Annotated[MeshFile, Tag("file")] | Annotated[AnyShape, Tag("shape")], Discriminator(_mesh_kind)
]


class Transform(Description):
    """Where an object stands: scaled, rotated, fitted, translated, in this order, then the matrix."""

    scale: Annotated[Vector, Shorthand(spread)] = (1.0, 1.0, 1.0)
    """One factor, or one per axis; negative ones mirror."""
    rotate: Vector = (0.0, 0.0, 0.0)
    """About x, then y, then z [degrees]."""
    fit: Positive | None = None
    """Scale and move what is rotated so that half its box's diagonal is this long and it stands on y = 0,
    centred on the y axis [scene units]."""
    translate: Vector = (0.0, 0.0, 0.0)
    """By how much it is moved along x, y and z [scene units]."""
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
    """Grain in rings about an axis, as on a turned or brushed disc."""

    axis: Direction = (0.0, 1.0, 0.0)
    """Direction of the axis, in the object's own coordinates."""
    centre: Vector = (0.0, 0.0, 0.0)
    """A point on the axis, in the object's own coordinates before its transform."""


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
    """A mesh with a material in a place."""

    mesh: NameOrMesh
    """The name of a mesh, the path of a mesh file, or a mesh described in place."""
    name: Name | None = None
    """Names the object in messages, overrides and files; by default `object1` and so on."""
    material: NameOrMaterial | None = None
    """The name of a material, or one described in place; by default the materials that the mesh file
    selects by name, and light grey Lambert for what selects none."""
    fallback: NameOrMaterial | None = None
    """Where no `material` is given: show the materials, textures and vertex colours that the mesh file itself
    describes, whatever the scene calls its own, and this material, by name or in place, where it has none.
    What MTL calls intensities are shares of the light then, and ambient light leaves by diffuse colours."""
    override: dict[str, Any] = DEFAULTS
    """Parameters of the material that this object has otherwise."""
    transform: Transform = DEFAULTS
    """Where it stands, and how large."""
    shading: Rate | None = None
    """How often its material is evaluated; by default as often as the scene says."""
    grain: AnyGrain | None = None
    """Tangent of anisotropic materials: a direction the grain follows, or rings about an axis;
    by default the direction of growing u."""


class _Camera(Description):
    position: Vector = (1.8, 1.9, 3.6)
    """Where the eye is [scene units]; by default where it sees an object fitted to radius 1."""
    target: Vector = (0.0, 0.75, 0.0)
    """What it looks at, the middle of the picture [scene units]."""
    up: Direction = (0.0, 1.0, 0.0)
    """Any vector not along the line of sight; where it is, another axis is taken."""
    fit: Name | None = None
    """Name of the object that is to fill the picture: the camera keeps its direction and moves to where all
    of the object is inside; an orthographic one also takes its extent from it."""
    width: Count | None = None
    """Width of its picture [pixels]; by default the film's."""
    height: Count | None = None
    """Height of its picture [pixels]; by default the film's."""
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
    """The pixel filter, by sampling positions from it: pixels share no samples."""

    filter: Literal["box", "tent", "gaussian"] = "box"
    """`box`: all samples of the pixel weigh the same. `tent`: less, the farther from the pixel's centre.
    `gaussian`: by a bell curve, the softest."""
    width: Positive = 1.0
    """Support of box and tent, and two standard deviations of the Gaussian, either side [half pixels]."""


class Adaptive(Description):
    """Few samples for every pixel, and all of them only where these differ from each other or from those of
    the neighbouring pixels: in object or normal, and each layer in its own light.

    Not unbiased: what the few samples miss, as things smaller than the gaps between them, stays missed.
    """

    first: Count = 4
    """Samples that every pixel gets."""
    difference: Annotated[float, Field(gt=0, le=1)] = 0.1
    """How far light may differ among them, as a share of the brightest."""


def _adaptive(value: Any) -> Any:
    return {"first": value} if isinstance(value, int) and not isinstance(value, bool) else value


AdaptiveOrCount: TypeAlias = Annotated[
    Adaptive, BeforeValidator(_adaptive, json_schema_input_type=Adaptive | Count)
]


class Film(Description):
    """Size and sampling of the picture."""

    width: Count = 1280
    """Width of the picture [pixels]."""
    height: Count = 720
    """Height of the picture [pixels]."""
    samples: Count = 4
    """Per pixel; 1 looks through the pixel's centre."""
    adaptive: (
        Annotated[Adaptive, BeforeValidator(_adaptive, json_schema_input_type=Adaptive | Count)] | None
    ) = None
    """Take all samples only where fewer differ; a number says how many every pixel gets. By default every
    pixel gets all."""
    filter: Filter = DEFAULTS
    """From which part of and around a pixel its samples come."""
    background: Color | None = None
    """Behind everything; by default nothing, with alpha 0."""
    exposure: Annotated[float, Field(ge=-64, le=64)] = 0.0
    """Of 8-bit pictures [stops]; EXR keeps the light as it is."""


def _ambient(value: Any) -> Any:
    if value in FORMS:
        return {"form": value, "color": 1.0}
    if isinstance(value, str) and not value.startswith("#"):
        raise ValueError(f"must be {COLOR}, or a form (separate, coupled), is {describe(value)}")
    return {"color": value} if isinstance(value, str | int | float | list | tuple) else value


FORMS = ("separate", "coupled")


class Ambient(Description):
    """I_a, light from everywhere, weighed by obscurance."""

    color: Color = (0.0, 0.0, 0.0)
    """I_a, its colour; black is none."""
    form: Literal["separate", "coupled"] = "separate"
    """`separate`: k_a I_a w + direct. `coupled`: (k_a I_a + direct) w + I_d, as one text prints it, with I_d
    the direct light before the material; it counts direct light twice."""


AmbientText: TypeAlias = Ambient | Color | Literal["separate", "coupled"]  # how a scene may write it


class DepthCue(Description):
    """Depth cueing: what is far away fades into a colour, whatever its material and light.

    L' = (1 - a) L + a color,  a = strength * (distance - near) / (far - near), held within 0..strength

    After Warnock (1969), A hidden surface algorithm for computer generated halftone pictures, University of
    Utah, where intensity falls with the distance from the eye. No light behaves so; it orders by depth.
    """

    near: NonNegative
    """Distance from the eye up to which nothing fades [scene units]."""
    far: Positive
    """Distance from which on it fades no further [scene units]."""
    strength: Share = 1.0
    """How much of the colour replaces the surface's at `far`."""
    color: Color = (0.0, 0.0, 0.0)
    """What it fades into: black, or the background's colour, as haze does."""

    @model_validator(mode="after")
    def _fades_somewhere(self) -> Self:
        if self.near >= self.far:
            raise ValueError(f"near must be below far, is {self.near:g} with far {self.far:g}")
        return self


class Obscurance(Description):
    """w(p) by Monte Carlo: how open each point is to the ambient light."""

    samples: Annotated[int, Field(ge=1, le=65536)] = 64
    """Rays per pixel sample."""
    falloff: AnyFalloff = default_of({"falloff": "step"})
    """By default every occluder counts fully: ambient occlusion."""
    sampler: Sampler = "spiral"
    """Which directions the rays of a point have."""
    faces: Literal["count", "ignore", "one_sided"] = "count"
    """What becomes of a ray that meets a face from behind. `count`: the face hides like any other. `ignore`:
    the ray passes through. `one_sided`: it counts as free."""
    about: Literal["shading", "geometric"] = "shading"
    """What the hemisphere stands about. `shading`: the interpolated normal that direct light is shaded with;
    directions that point below the polygon are mirrored at its plane. `geometric`: the polygon's own."""


class Outputs(Description):
    """What is written."""

    layers: Annotated[ListOf[Layer], Field(min_length=1)] = ("beauty",)
    """What is made of the scene."""
    files: Annotated[ListOf[str], Field(min_length=1)] = ("{scene}.{camera}.png",)
    """Name patterns, from the current folder: `.exr` holds every layer in one file, `.png` is one
    file per layer (`{layer}` in its name when there are several): light as sRGB, all else as plain numbers;
    text in the file says how to read them."""
    colour: Literal["half", "float"] = "half"
    """Precision of colour in EXR; depth, positions, normals and ids are always 32-bit. `half`: 16 bits, up to
    65504. `float`: 32 bits."""


class Scene(Description):
    """Everything a scene file says."""

    version: Literal[1]
    """Version of the scene format."""
    camera: Camera | None = None
    """The one camera, named `main`."""
    cameras: dict[Name, Camera] = DEFAULTS
    """Several cameras by name; instead of `camera`."""
    film: Film = DEFAULTS
    """Size and sampling of the picture."""
    shading: Rate = "phong"
    """How often the model is evaluated."""
    terminator: Literal["smooth", "none"] = "smooth"
    """Where shadows of smooth shading begin. `smooth`: on the surface that the normals imply, so that coarse
    polygons cast no shadow on its lit side. `none`: on the polygons themselves."""
    ambient: Annotated[Ambient, BeforeValidator(_ambient, json_schema_input_type=AmbientText)] = DEFAULTS
    """Colour, form or both of the light from everywhere. `separate`: it is added to the direct light.
    `coupled`: it is weighed together with it, as one text prints it."""
    obscurance: Obscurance | None = None
    """How the ambient light is weighed by what surrounds a point; by default w = 1 and no ray is cast for
    it."""
    depth_cue: DepthCue | None = None
    """Fade the beauty with the distance from the eye; by default not."""
    meshes: dict[Name, MeshSource] = DEFAULTS
    """Files and shapes by name, for objects to share."""
    materials: dict[Name, AnyModel] = DEFAULTS
    """Illumination models with their parameters by name, for objects and mesh files to select."""
    objects: ListOf[Object] = ()
    """What is seen: meshes with their material and place."""
    lights: ListOf[AnyLight] = ()
    """Lamps and suns; without any, what is lit is lit by ambient light alone."""
    outputs: Outputs = DEFAULTS
    """Layers and files that are written."""
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    """Of every random number: the same seed makes the same picture."""

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
        """The object's own material with its overrides; None where the mesh selects materials."""
        material = thing.material
        model = self.materials[material] if isinstance(material, str) else material
        if not thing.override:
            return model
        base = model or self.fallback_of(thing) or default_material()
        return type(base).model_validate({**dict(base), **thing.override})

    def fallback_of(self, thing: Object) -> AnyModel | None:
        """The object's fallback; None where it has a material or asks for no other."""
        fallback = thing.fallback
        if thing.material is not None:
            return None
        return self.materials[fallback] if isinstance(fallback, str) else fallback

    def named_cameras(self) -> dict[str, Perspective | Orthographic]:
        """The cameras by name, at least one."""
        return self.cameras or {"main": self.camera or Perspective()}

    def named_lights(self) -> dict[str, AnyLight]:
        """The lights by name: their own, or their type and number."""
        return {l.name or f"{dict(l)['light']}{i + 1}": l for i, l in enumerate(self.lights)}

    def object_names(self) -> tuple[str, ...]:
        return tuple(o.name or f"object{i + 1}" for i, o in enumerate(self.objects))


def default_material() -> AnyModel:
    """Light grey Lambert, for what has no material."""
    from illumcli.models.lambert import Lambert

    return Lambert()
