"""Scenes at the limits of their parameters: each must render without a fault, or be refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from illumcli.errors import IllumError
from illumcli.shading.rates import RATES
from illumcli.stress.sandbox import CheckResult, Sandbox, faults, is_refusal, refusal

Scene = dict[str, Any]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
BALL: Scene = {"mesh": {"shape": "sphere", "segments": 24, "rings": 12}}
BOX: Scene = {"mesh": {"shape": "box"}}
FLOOR: Scene = {
    "mesh": {"shape": "plane", "size": [8, 8]}, "transform": {"translate": [0, -1, 0]}, "material": "grey"
}  # fmt: skip
CAMERA: Scene = {"position": [2.5, 2, 4], "target": [0, 0, 0]}
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def lamp(*position: float, **more: Any) -> Scene:
    return {"light": "point", "position": list(position), "intensity": 30, **more}


def scene(*objects: Scene, lights: Sequence[Scene] | None = None, scale: float = 1, **more: Any) -> Scene:
    """A scene with ambient light, obscurance and a highlight; `scale` is that of the default light."""
    far = [[scale * x for x in p] for p in ([3, 4, 5], [-3, 2, 1], [2.5, 2, 4])]
    default = [
        lamp(*far[0], intensity=30 * scale * scale),
        {"light": "spot", "position": far[1], "target": [0, 0, 0], "intensity": 9 * scale * scale},
        {"light": "directional", "direction": [1, -2, -1], "irradiance": 0.5},
    ]
    return {
        "camera": {"position": far[2], "target": [0, 0, 0]},
        "ambient": [0.3, 0.4, 0.5],
        "obscurance": {"samples": 16},
        "materials": {
            "grey": {"model": "lambert", "diffuse": 0.7},
            "shiny": {"model": "blinn_phong", "diffuse": 0.5, "specular": 0.4, "exponent": 40},
        },
        "objects": [{"material": "shiny", **each} for each in objects],
        "lights": default if lights is None else list(lights),
        **more,
    }


def polygons(vertices: Sequence[Sequence[float]], faces: Sequence[Sequence[int]], **more: Any) -> Scene:
    mesh = {"shape": "polygons", "vertices": [list(v) for v in vertices], "faces": [list(f) for f in faces]}
    return {"mesh": mesh, **more}


def sheets(gap: float) -> Scene:
    """Two squares, with a `gap` between them."""
    above = [[x, y, z + gap] for x, y, z in SQUARE]
    return polygons([*SQUARE, *above], [(0, 1, 2, 3), (4, 5, 6, 7)])


def shiny(exponent: float, model: str = "phong") -> Scene:
    return {"model": model, "specular": 0.5, "exponent": exponent}


def scaled(size: float, *away: float) -> Scene:
    """Ball and floor of `size`, with camera and lights, moved from the origin by `away`."""

    def there(x: float, y: float, z: float) -> list[float]:
        return [size * x + away[0], size * y + away[1], size * z + away[2]]

    move = {"scale": size, "translate": list(away)}
    floor = {**FLOOR, "transform": {"scale": size, "translate": there(0, -1, 0)}}
    lights = [
        lamp(*there(3, 4, 5), intensity=min(30 * size * size, 1e18)),
        {
            "light": "spot",
            "position": there(-3, 2, 1),
            "target": there(0, 0, 0),
            "intensity": min(9 * size * size, 1e18),
        },
        {"light": "directional", "direction": [1, -2, -1], "irradiance": 0.5},
    ]
    return scene(
        {**BALL, "transform": move}, floor, lights=lights,
        camera={"position": there(2.5, 2, 4), "target": there(0, 0, 0)},
    )  # fmt: skip


def obj(sandbox: Sandbox, text: str, **more: Any) -> Scene:
    """A scene with an OBJ mesh file of this text."""
    return scene({"mesh": sandbox.file(f"mesh{sandbox.pictures}.obj", text.encode())}, FLOOR, **more)


MUST_RENDER: dict[str, Callable[[Sandbox], Scene]] = {
    "empty scene": lambda sandbox: {},
    "empty scene with lights and obscurance": lambda sandbox: scene(),
    "all vertices one point": lambda sandbox: scene(polygons([[1, 2, 3]] * 3, [(0, 1, 2)])),
    "one face without area": lambda sandbox: scene(
        polygons([*SQUARE, [2, 2, 0]], [(0, 1, 2, 3), (0, 2, 4)]), FLOOR
    ),
    "all faces without area": lambda sandbox: scene(polygons([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [(0, 1, 2)])),
    "a face that names one vertex thrice": lambda sandbox: obj(sandbox, TRIANGLE + "f 1 2 3\nf 2 2 2\n"),
    "needle 1:1e6": lambda sandbox: scene(
        polygons([[-1, 0, 0], [1, 0, 0], [0, 2e-6, 0]], [(0, 1, 2)]), FLOOR
    ),
    "needle seen along": lambda sandbox: scene(
        polygons([[-1, 0, 0], [1, 0, 0], [0, 2e-6, 0]], [(0, 1, 2)]),
        camera={"position": [3, 1e-6, 0], "target": [0, 1e-6, 0]},
    ),
    "ball squeezed 1:1e6": lambda sandbox: scene({**BALL, "transform": {"scale": [1, 1, 1e-6]}}, FLOOR),
    "ball squeezed to nothing": lambda sandbox: scene({**BALL, "transform": {"scale": [1, 1, 0]}}, FLOOR),
    "object scaled to a point": lambda sandbox: scene({**BALL, "transform": {"scale": 0}}, FLOOR),
    "two sheets in one place": lambda sandbox: scene(sheets(0), FLOOR),
    "two sheets 1e-7 apart": lambda sandbox: scene(sheets(1e-7), FLOOR),
    "two balls in one place": lambda sandbox: scene(BALL, {**BALL, "material": "grey"}, FLOOR),
    "size 1e-9": lambda sandbox: scaled(1e-9, 0, 0, 0),
    "size 1e9": lambda sandbox: scaled(1e9, 0, 0, 0),
    "1e6 radii away": lambda sandbox: scaled(1, 6e6, -6e6, 6e6),
    "size 1e-9, 1e6 radii away": lambda sandbox: scaled(1e-9, 6e-3, -6e-3, 6e-3),
    "vertices at 1e18": lambda sandbox: scene(
        polygons([[1e18, 0, 0], [0, 1e18, 0], [0, 0, 1e18]], [(0, 1, 2)])
    ),
    "a vertex at 1e18 beside a ball": lambda sandbox: scene(
        BALL, polygons([[0, 0, 0], [1, 0, 0], [0, -1e18, 0]], [(0, 1, 2)])
    ),
    "a triangle of 1e-8 in a scene of 1": lambda sandbox: scene(
        polygons([[0, 0, 0], [1e-8, 0, 0], [0, 1e-8, 0]], [(0, 1, 2)]),
        FLOOR,
        camera={"position": [2e-9, 2e-9, 1e-7], "target": [2e-9, 2e-9, 0]},
    ),
    "faces that name a vertex twice": lambda sandbox: obj(sandbox, TRIANGLE + "f 1 1 2\nf 1 2 3\n"),
    "normals of length 0 and 1e-30": lambda sandbox: obj(
        sandbox, TRIANGLE + "vn 0 0 0\nvn 0 0 1e-30\nf 1//1 2//2 3//1\n"
    ),
    "normals against their faces": lambda sandbox: obj(sandbox, TRIANGLE + "vn 0 0 -1\nf 1//1 2//1 3//1\n"),
    "normals along their faces": lambda sandbox: obj(sandbox, TRIANGLE + "vn 1 0 0\nf 1//1 2//1 3//1\n"),
    "normals that cancel within a face": lambda sandbox: obj(
        sandbox, TRIANGLE + "vn 1 0 0\nvn -1 0 0\nf 1//1 2//2 3//1\n"
    ),
    "a mirrored matrix": lambda sandbox: scene({**BALL, "transform": {"scale": [-1, 1, 1]}}, FLOOR),
    "light on a vertex": lambda sandbox: scene(BOX, FLOOR, lights=[lamp(1, 1, 1)]),
    "light on a face": lambda sandbox: scene(BOX, FLOOR, lights=[lamp(0.3, 1, 0.2)]),
    "light on the floor": lambda sandbox: scene(BOX, FLOOR, lights=[lamp(1.7, -1, 0.9)]),
    "light 1e-12 above a face": lambda sandbox: scene(BOX, FLOOR, lights=[lamp(0.3, 1 + 1e-12, 0.2)]),
    "light inside a solid": lambda sandbox: scene(BOX, FLOOR, lights=[lamp(0, 0, 0)]),
    "light where the eye looks": lambda sandbox: scene(
        polygons(SQUARE, [(0, 1, 2, 3)]),
        lights=[lamp(0.5, 0.5, 0)],
        camera={"position": [0.5, 0.5, 2], "target": [0.5, 0.5, 0]},
        film={"width": 3, "height": 3, "samples": 1},
    ),
    "light in the eye": lambda sandbox: scene(BALL, FLOOR, lights=[lamp(2.5, 2, 4)]),
    "light 1e18 away": lambda sandbox: scene(
        BALL,
        FLOOR,
        lights=[lamp(1e18, 1e18, 0, intensity=1e18), lamp(0, 1e18, 0, attenuation={"law": "none"})],
    ),
    "lights of all laws at distance 0": lambda sandbox: scene(
        BOX,
        FLOOR,
        lights=[
            lamp(1, 1, 1, attenuation=law)
            for law in (
                {"law": "polynomial", "c1": 0, "c3": 1},
                {"law": "polynomial", "c1": 0, "c2": 1},
                {"law": "inverse_square_flux"},
                {"law": "windowed", "range": 2},
                {"law": "windowed", "range": 1e-9},
            )
        ],
    ),
    "attenuation of 1e18": lambda sandbox: scene(
        BALL,
        FLOOR,
        lights=[lamp(3, 4, 5, attenuation={"law": "polynomial", "c1": 1e18, "c2": 1e18, "c3": 1e18})],
    ),
    "light of 1e18": lambda sandbox: scene(BALL, FLOOR, lights=[lamp(3, 4, 5, intensity=1e18)]),
    "light of 1e-18": lambda sandbox: scene(BALL, FLOOR, lights=[lamp(3, 4, 5, intensity=1e-18)]),
    "spot of 1e-3 degrees": lambda sandbox: scene(
        BALL,
        FLOOR,
        lights=[
            {"light": "spot", "position": [0, 4, 0], "angle": 1e-3, "softness": s, "intensity": 9}
            for s in (0, 1)
        ],
    ),
    "spot of 180 degrees": lambda sandbox: scene(
        BALL, FLOOR, lights=[{"light": "spot", "position": [0, 4, 0], "angle": 180, "intensity": 9}]
    ),
    "spot inside a solid": lambda sandbox: scene(
        BALL, FLOOR, lights=[{"light": "spot", "position": [0, 0.1, 0], "intensity": 9}]
    ),
    "shininess 0": lambda sandbox: scene(
        {**BALL, "material": shiny(0)}, {**FLOOR, "material": shiny(0, "blinn_phong")}
    ),
    "shininess 1e6": lambda sandbox: scene(
        {**BALL, "material": shiny(1e6)}, {**FLOOR, "material": shiny(1e6, "blinn_phong")}
    ),
    "shininess 1e18": lambda sandbox: scene(
        {**BALL, "material": shiny(1e18)}, {**FLOOR, "material": shiny(1e18, "blinn_phong")}
    ),
    "albedo 1e18": lambda sandbox: scene(
        {**BALL, "material": {"model": "phong", "diffuse": 1e18, "specular": 1e18}}, FLOOR
    ),
    "camera inside a solid": lambda sandbox: scene(
        BOX, FLOOR, camera={"position": [0.1, 0.2, 0.1], "target": [1, 0, 0]}, lights=[lamp(0, 0.5, 0)]
    ),
    "camera on a face": lambda sandbox: scene(
        BOX, FLOOR, camera={"position": [0, 0, 1], "target": [0.4, 0, 0]}
    ),
    "camera in a face, looking along it": lambda sandbox: scene(
        BOX, FLOOR, camera={"position": [-0.5, 0, 1], "target": [1, 0, 1]}
    ),
    "camera on a vertex": lambda sandbox: scene(
        BOX, FLOOR, camera={"position": [1, 1, 1], "target": [0, 0, 0]}
    ),
    "camera along an edge": lambda sandbox: scene(
        BOX, FLOOR, camera={"position": [3, 1, 1], "target": [-1, 1, 1]}
    ),
    "camera along the floor": lambda sandbox: scene(
        BOX, FLOOR, camera={"position": [5, -1, 0], "target": [0, -1, 0]}
    ),
    "up along the line of sight": lambda sandbox: scene(
        BALL, FLOOR, camera={"position": [0, 5, 0], "target": [0, 0, 0], "up": [0, 1, 0]}
    ),
    "up of length 1e-18": lambda sandbox: scene(BALL, FLOOR, camera={**CAMERA, "up": [0, 1e-18, 0]}),
    "up of length 1e18": lambda sandbox: scene(BALL, FLOOR, camera={**CAMERA, "up": [1e18, 1e18, 0]}),
    "target 1e-12 from the eye": lambda sandbox: scene(
        BALL, FLOOR, camera={"position": [2.5, 2, 4], "target": [2.5, 2, 4 - 1e-12]}
    ),
    "camera 1e6 radii away": lambda sandbox: scene(
        BALL, FLOOR, camera={"position": [0, 2e6, 6e6], "target": [0, 0, 0], "fov": 0.001}
    ),
    "camera 1e18 away": lambda sandbox: scene(
        BALL, FLOOR, camera={"position": [0, 0, 1e18], "target": [0, 0, 0]}
    ),
    "field of view 0.001": lambda sandbox: scene(BALL, FLOOR, camera={**CAMERA, "fov": 0.001}),
    "field of view 179.9": lambda sandbox: scene(BALL, FLOOR, camera={**CAMERA, "fov": 179.9}),
    "field of view 180 - 1e-9": lambda sandbox: scene(BALL, FLOOR, camera={**CAMERA, "fov": 180 - 1e-9}),
    "parallel view of 1e-9 and of 1e9": lambda sandbox: scene(
        BALL,
        FLOOR,
        cameras={f"c{e}": {**CAMERA, "projection": "orthographic", "extent": float(f"1e{e}")} for e in (9,)},
        camera=None,
    ),
    "an image of 1 x 1": lambda sandbox: scene(BALL, FLOOR, film={"width": 1, "height": 1, "samples": 16}),
    "an image of 1 x 10,000": lambda sandbox: scene(
        BALL, FLOOR, film={"width": 1, "height": 10000, "samples": 1}
    ),
    "an image of 10,000 x 1": lambda sandbox: scene(
        BALL, FLOOR, film={"width": 10000, "height": 1, "samples": 1}
    ),
    "one obscurance ray": lambda sandbox: scene(BALL, FLOOR, obscurance={"samples": 1}),
    "every falloff": lambda sandbox: scene(
        BALL, FLOOR, obscurance={"samples": 3, "falloff": {"falloff": "exponential", "tau": 1e18}}
    ),
    "falloff of 1e-18": lambda sandbox: scene(
        BALL,
        FLOOR,
        obscurance={"samples": 3, "falloff": {"falloff": "exponential", "tau": 1e-18, "max_distance": 1e-18}},
    ),
    "power falloff of 1e18": lambda sandbox: scene(
        BALL,
        FLOOR,
        obscurance={"samples": 3, "falloff": {"falloff": "power", "exponent": 1e18, "max_distance": "1r"}},
    ),
    "smooth falloff of 1e18 radii": lambda sandbox: scene(
        BALL, FLOOR, obscurance={"samples": 3, "falloff": {"falloff": "smooth", "max_distance": "1e18r"}}
    ),
    "coupled ambient light": lambda sandbox: scene(BALL, FLOOR, ambient={"color": 1e18, "form": "coupled"}),
    "emission of 1e18": lambda sandbox: scene(
        {**BALL, "material": {"model": "lambert", "emission": 1e18}}, FLOOR
    ),
}
"""Name -> scene that must render."""

MUST_REFUSE: dict[str, Callable[[Sandbox], Scene]] = {
    "a mesh without faces": lambda sandbox: obj(sandbox, TRIANGLE),
    "a mesh file of 0 bytes": lambda sandbox: obj(sandbox, ""),
    "a NaN vertex": lambda sandbox: obj(sandbox, "v nan 0 0\n" + TRIANGLE + "f 1 2 3\n"),
    "an infinite vertex": lambda sandbox: obj(sandbox, "v inf 0 0\n" + TRIANGLE + "f 1 2 3\n"),
    "a vertex at 1e300": lambda sandbox: obj(sandbox, "v 1e300 0 0\n" + TRIANGLE + "f 1 2 3\n"),
    "a vertex at 1e19": lambda sandbox: obj(sandbox, "v 1e19 0 0\n" + TRIANGLE + "f 1 2 3\n"),
    "attenuation of 0": lambda sandbox: scene(
        BALL, lights=[lamp(1, 2, 3, attenuation={"law": "polynomial", "c1": 0, "c2": 0, "c3": 0})]
    ),
    "a film of 1e6 x 1e6": lambda sandbox: scene(BALL, film={"width": 1000000, "height": 1000000}),
    "1e12 rays": lambda sandbox: scene(
        BALL, film={"width": 10000, "height": 10000, "samples": 1}, obscurance={"samples": 10000}
    ),
    "a coordinate of 1e39": lambda sandbox: scene(BALL, lights=[lamp(1e39, 0, 0)]),
    "a field of view of 180": lambda sandbox: scene(BALL, camera={**CAMERA, "fov": 180}),
}
"""Name -> scene that must be refused."""


def check_scenes(sandbox: Sandbox, quick: bool) -> list[CheckResult]:
    """A result for each scene: rendered at every shading rate, or refused."""
    rates = ("phong", "gouraud") if quick else tuple(RATES)
    size = {"width": 24, "height": 18, "samples": 1} if quick else {"width": 120, "height": 90, "samples": 2}
    results = [_rendered(name, make, sandbox, rates, size) for name, make in MUST_RENDER.items()]
    return results + [_refused(name, make, sandbox) for name, make in MUST_REFUSE.items()]


def _rendered(
    name: str,
    make: Callable[[Sandbox], Scene],
    sandbox: Sandbox,
    rates: Sequence[str],
    size: Mapping[str, int],
) -> CheckResult:
    check, wrong = "finite, nothing below 0, shares within 1", []
    for rate in rates:
        description = {"film": dict(size), "shading": rate, **make(sandbox)}
        if description.get("camera", "") is None:
            del description["camera"]
        try:
            channels, _ = sandbox.render(description)
            wrong += [f"{rate}: {fault}" for fault in faults(channels)]
        except IllumError as error:
            wrong.append(f"{rate}: {refusal(error)}")
        except Exception as error:  # an unexpected exception is a finding; the suite continues
            wrong.append(f"{rate}: {type(error).__name__}: {error}")
    return CheckResult(name, check, wrong[0] if wrong else "-", not wrong)


def _refused(name: str, make: Callable[[Sandbox], Scene], sandbox: Sandbox) -> CheckResult:
    try:
        sandbox.render(make(sandbox))
        worst, passed = "rendered", False
    except IllumError as error:
        worst, passed = refusal(error), is_refusal(error)
    except Exception as error:
        worst, passed = f"{type(error).__name__}: {error}", False
    return CheckResult(name, "refused", worst if not passed else worst.partition(":")[0], passed)
