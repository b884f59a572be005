"""The geometry of the obscurance cases as real triangles around a receiver at the origin that faces +z.

What the closed forms take as infinite is built so large that the rest would block less than 10^-5 of the
light. Round shapes are polygons of the same area, or have their corners raised until facets lie at the right
distance on average; either leaves an error of second order, below 10^-5. Flat receivers lie on a floor, so
that rays which hit the surface they start from are noticed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.records import Record
from illumcli.verification.inputs import Inputs

ENDLESS = 1e5
"""Size of infinite walls, in distances to the wall."""
LONG = 1e2
"""Length of infinite walls of finite height, in heights or distances; the error falls with its cube."""
WIDE = 3e2
"""Half width of infinite plates, in heights; side walls close them."""
SIDES = 256
"""Corners of the polygon that approximates a circle."""


class Surroundings(Record):
    """Triangles around a receiver at the origin that faces +z."""

    vertices: NDArray[np.float64]  # (V, 3)
    triangles: NDArray[np.int32]  # (T, 3)

    def __add__(self, other: Surroundings) -> Surroundings:
        return Surroundings(
            np.concatenate([self.vertices, other.vertices]),
            np.concatenate([self.triangles, other.triangles + np.int32(len(self.vertices))]),
        )

    @property
    def size(self) -> float:
        """The largest coordinate."""
        return float(np.abs(self.vertices).max())


def surroundings(inputs: Inputs) -> Surroundings:
    """The geometry that the case names, with a floor if the receiver is flat."""
    return inputs.choose("geometry", GEOMETRIES)(inputs)


def patch(corners: ArrayLike) -> Surroundings:
    """A convex polygon."""
    vertices = np.asarray(corners, np.float64)
    second = np.arange(1, len(vertices) - 1, dtype=np.int32)
    return Surroundings(vertices, np.stack([np.zeros_like(second), second, second + 1], axis=1))


def floor(size: float) -> Surroundings:
    """A hexagon in z = 0 around the origin, which lies inside its middle triangle."""
    angle = np.pi / 3 * np.arange(6)
    vertices = size * np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    return Surroundings(vertices, np.array([[0, 2, 4], [0, 1, 2], [2, 3, 4], [4, 5, 0]], np.int32))


def on_floor(size: float, *parts: Surroundings) -> Surroundings:
    """The parts and a floor of this size under the receiver; the larger it is, the larger are ray offsets."""
    scene = floor(size)
    for part in parts:
        scene = scene + part
    return scene


def upright(start: ArrayLike, end: ArrayLike, height: float) -> Surroundings:
    """A vertical wall over the line from `start` to `end`.

    It reaches as far below the floor as above, which keeps the scene's centre, where precision is best, at
    the receiver.
    """
    (x0, y0), (x1, y1) = np.asarray(start, float), np.asarray(end, float)
    return patch([[x0, y0, -height], [x1, y1, -height], [x1, y1, height], [x0, y0, height]])


def circle(radius: float, sides: int = SIDES) -> NDArray[np.float64]:
    """(sides, 2) corners of a regular polygon with the area of the circle."""
    step = 2 * np.pi / sides
    angle = step * np.arange(sides)
    return radius * np.sqrt(step / np.sin(step)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def revolved(profile: NDArray[np.float64], sides: int) -> Surroundings:
    """A surface of revolution about z through (distance from the axis, height) pairs."""
    around = circle(1.0, sides)
    rings = len(profile)
    vertices = np.empty((rings, sides, 3))
    vertices[..., :2] = profile[:, None, :1] * around
    vertices[..., 2] = profile[:, None, 1]
    ring, side = (grid.ravel() for grid in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    a, b = ring * sides + side, ring * sides + (side + 1) % sides
    triangles = np.concatenate(
        [np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)]
    )
    return Surroundings(vertices.reshape(-1, 3), triangles.astype(np.int32))


def raised_arc(angles: NDArray[np.float64], sides: int) -> NDArray[np.float64]:
    """(k, 2) profile of a ball of radius 1 about the origin at these angles from +z, for facets that lie at
    distance 1 on average.

    Over a facet of angular steps p and q the sagitta takes off (p^2 + q^2) / 12 on average. `revolved` widens
    circles about the axis to polygons of the same area, which is taken back here.
    """
    step = np.gradient(angles)
    sideways = 2 * np.pi / sides
    widened = np.sqrt(sideways / np.sin(sideways))
    raised = 1 + step**2 / 12 + (sideways * np.sin(angles)) ** 2 / 12
    return np.stack([raised * np.sin(angles) / widened, raised * np.cos(angles)], axis=1)


def wall(inputs: Inputs) -> Surroundings:
    """An infinite wall at x = a."""
    a, height = inputs.number("a"), _height_or_none(inputs)
    along, up = _reach(a, height)
    return on_floor(a / 2, upright([a, -along], [a, along], up))


def wall_finite(inputs: Inputs) -> Surroundings:
    """A wall at x = a from y = -w1 to w2."""
    a, w1, w2, height = (inputs.number(key) for key in ("a", "w1", "w2", "height"))
    return on_floor(a / 2, upright([a, -w1], [a, w2], height))


def corner(inputs: Inputs) -> Surroundings:
    """Two infinite walls at x = a and y = b; each ends where the other hides it."""
    a, b, height = inputs.number("a"), inputs.number("b"), _height_or_none(inputs)
    along, up = _reach(max(a, b), height)
    return on_floor(min(a, b) / 2, upright([a, -along], [a, along], up), upright([-along, b], [along, b], up))


def disc(inputs: Inputs) -> Surroundings:
    """A disc parallel to the floor, its centre above the receiver."""
    rim, height = circle(inputs.number("radius")), inputs.number("height")
    return on_floor(height, patch(np.column_stack([rim, np.full(len(rim), height)])))


def well(inputs: Inputs) -> Surroundings:
    """A cylindrical well, seen from the centre of its bottom."""
    radius, depth = inputs.number("radius"), inputs.number("depth")
    return on_floor(min(radius, depth) / 2, revolved(np.array([[radius, -depth], [radius, depth]]), SIDES))


def sphere(inputs: Inputs) -> Surroundings:
    """A ball above the horizon."""
    radius, centre = inputs.number("radius"), inputs.vectors("center")[0].astype(np.float64)
    return on_floor(radius, _ball(radius, centre))


def sphere_on_floor(inputs: Inputs) -> Surroundings:
    """A ball that touches the floor at a distance."""
    radius = inputs.number("radius")
    return on_floor(radius, _ball(radius, np.array([inputs.number("distance"), 0.0, radius])))


def rectangle(inputs: Inputs) -> Surroundings:
    """A rectangle parallel to the floor."""
    x0, x1, y0, y1, h = (inputs.number(key) for key in ("x0", "x1", "y0", "y1", "height"))
    return on_floor(h, patch([[x0, y0, h], [x1, y0, h], [x1, y1, h], [x0, y1, h]]))


def polygon(inputs: Inputs) -> Surroundings:
    """A convex polygon above the floor."""
    ceiling = patch(inputs.vectors("vertices"))
    return on_floor(ceiling.size / 100, ceiling)


def vgroove(inputs: Inputs) -> Surroundings:
    """The receiver at x from the bottom edge of a groove of opening angle gamma."""
    x, gamma, span = inputs.number("x"), inputs.number("gamma"), inputs.number_or_none("length")
    along = LONG * max(x, span) if span else ENDLESS * x
    span = span or ENDLESS * x
    tip, top = x - span * np.cos(gamma), span * np.sin(gamma)
    return on_floor(x / 2, patch([[x, -along, 0], [x, along, 0], [tip, along, top], [tip, -along, top]]))


def dome(inputs: Inputs) -> Surroundings:
    """A hemisphere around the receiver; it continues below the floor."""
    radius = inputs.number("radius")
    return on_floor(radius / 2, revolved(radius * raised_arc(np.linspace(0, 0.55 * np.pi, 71), 64), 64))


def sphere_inside(inputs: Inputs) -> Surroundings:
    """The receiver on the inside of a sphere, whose rings are denser near the receiver."""
    arc = raised_arc(np.pi * (1 - np.linspace(1, 0, 193) ** 1.5), 32)
    ball = revolved(inputs.number("radius") * arc, 32)
    return Surroundings(ball.vertices - ball.vertices[-1], ball.triangles)


def plate(inputs: Inputs) -> Surroundings:
    """An infinite plate parallel to the floor, with side walls where it is cut off."""
    h = inputs.number("height")
    half = max(WIDE * h, 3 * (inputs.number_or_none("d_max") or 0))
    return on_floor(h, _room(-half, half, -half, half, h))


def box_inside(inputs: Inputs) -> Surroundings:
    """A closed box, seen from a point of its floor."""
    x, y, z = inputs.vectors("size")[0].astype(float)
    px, py = inputs.points2("point").astype(float)
    return on_floor(min(x, y, z) / 100, _room(-px, x - px, -py, y - py, z))


def nothing(inputs: Inputs) -> Surroundings:
    """The floor alone."""
    return floor(1.0)


def _room(x0: float, x1: float, y0: float, y1: float, height: float) -> Surroundings:
    """Four walls and a ceiling."""
    feet = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    room = patch([[x, y, height] for x, y in feet])
    for start, end in zip(feet, feet[1:] + feet[:1], strict=True):
        room = room + upright(start, end, height)
    return room


def _ball(radius: float, centre: NDArray[np.float64]) -> Surroundings:
    """A sphere whose silhouette from the origin is a polygon with the area of the true silhouette.

    The axis points at the receiver; one ring of corners is where tangents from the receiver touch the ball.
    """
    # Rings from the pole that faces the receiver, one of them on the silhouette.
    away = float(np.linalg.norm(centre))
    tangent = max(float(np.arccos(min(radius / away, 1.0))), 1e-3)
    angles = np.unique(np.concatenate([[0, tangent], np.linspace(tangent, np.pi, 12)]))
    ball = revolved(radius * np.stack([np.sin(angles), np.cos(angles)], axis=1), SIDES)

    # Turn the pole to the receiver.
    z = -centre / away
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return Surroundings(ball.vertices @ np.stack([x, np.cross(z, x), z]) + centre, ball.triangles)


def _height_or_none(inputs: Inputs) -> float | None:
    return inputs.number_or_none("height") if "height" in inputs.values else None


def _reach(distance: float, height: float | None) -> tuple[float, float]:
    """Half length and height of a wall."""
    if height is None:
        return ENDLESS * distance, ENDLESS * distance
    return LONG * max(distance, height), height


GEOMETRIES: dict[str, Callable[[Inputs], Surroundings]] = {
    "open": nothing,
    "wall": wall,
    "wall_finite": wall_finite,
    "corner": corner,
    "disc": disc,
    "well": well,
    "sphere": sphere,
    "sphere_on_floor": sphere_on_floor,
    "rectangle": rectangle,
    "polygon": polygon,
    "vgroove": vgroove,
    "dome": dome,
    "sphere_inside": sphere_inside,
    "plate": plate,
    "box_inside": box_inside,
}
