"""w(p): how open points are, by Monte Carlo, with pixels and vertices sharing the code.

The statistical error of an estimate is not in its own rays: well-spread points err far less than independent
ones, so sqrt(p (1 - p) / N) is several times too wide. `Errors` learns from pairs of fresh scrambles at a few
points how the error goes with the *unevenness* that each point saw, and so gives every point an error of its
own without splitting its rays.
"""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, repeat_rows, take_rows
from illumcli.rays.embree import Tracer
from illumcli.rays.sampling import hashed, owen, sobol, spiral_table, unit_interval
from illumcli.records import Record, Value
from illumcli.visibility.falloffs._base import Falloff

Sampler: TypeAlias = Literal["spiral", "owen", "random"]
Faces: TypeAlias = Literal["count", "ignore", "one_sided"]

RAYS_AT_ONCE = 1 << 17
"""So many that the ray core has its cache to itself for long: a tenth faster than 2^14, of which directions,
origins and answers would stay in it; with two threads a fifth."""
MOST_SHEETS = 64
"""How many back faces in a row a ray passes through, when it does."""
STRIDE = 13
"""From the start of one ray to that of the next: neither neighbours on a spiral nor rays of one ring share
theirs, for 16 starts."""
GRAZING = 2.0**-20
"""Cosine of the flattest mirrored ray above the triangle that it leaves: rounding takes none below it."""


class Method(Record):
    """How w is estimated."""

    samples: int
    falloff: Falloff
    radius: float  # of the scene [scene units]
    sampler: Sampler = "spiral"
    faces: Faces = "count"
    facets: Vectors | None = None  # (T, 3) float32 normals of all triangles, unless every face counts

    @property
    def any_hit(self) -> bool:
        """Does it suffice to know that something is in the way?"""
        return self.falloff.step and self.faces == "count"


class Hemispheres(Record):
    """What the rays of M points leave, and about what.

    Ray i of a point starts at number i STRIDE of the E starts that it has, modulo E.
    """

    n: Vectors  # (M, 3) float32 unit shading normals, the axes
    origins: Vectors  # (M * E, 3) float32 off the surface, in radii; the starts of a point follow each other
    ng: Vectors | None = None
    """(M * E, 3) float32 unit normals of the triangles that the rays leave; None where they are `n`."""

    @property
    def starts(self) -> int:
        """E, of each point."""
        return len(self.origins) // max(len(self.n), 1)

    def take(self, lanes: slice | NDArray[np.int64]) -> Hemispheres:
        """Some of them, in this order."""
        each = self.starts
        if isinstance(lanes, slice):
            own: Any = slice(lanes.start * each, lanes.stop * each)
        else:
            own = lanes if each == 1 else (lanes[:, None] * each + np.arange(each)).ravel()

        def part(of: Vectors, which: Any) -> Vectors:
            return of[which] if isinstance(which, slice) else take_rows(of, which)

        ng = None if self.ng is None else part(self.ng, own)
        return Hemispheres(part(self.n, lanes), part(self.origins, own), ng)

    def of_rays(self, samples: int) -> NDArray[np.int64]:
        """(M * samples,) the start of every ray, one point after the other."""
        dealt = np.arange(samples) * STRIDE % self.starts
        return (np.arange(len(self.n))[:, None] * self.starts + dealt).ravel()


class Estimates(Record):
    """w at M points and what was seen on the way."""

    w: NDArray[np.float32]  # (M,) in [0, 1]
    neighbor_variation: NDArray[np.float32]  # (M,) sum of squared differences of mu between neighbouring rays
    bent: Vectors | None = None  # (M, 3) float32 unit mean direction of what is open; 0 where nothing is
    skipped: int = 0  # points known to be open, which cast no ray


def obscurance(
    tracer: Tracer,
    origins: Vectors,
    ng: Vectors,
    draws: NDArray[np.float64],
    samples: int,
    falloff: Falloff,
    radius: float,
) -> NDArray[np.float32]:
    """(M,) w alone, with the default sampler; see `estimates`."""
    method = Method(samples, falloff, radius)
    return estimates(tracer, Hemispheres(ng, origins), draws, method, errors=False).w


def estimates(
    tracer: Tracer,
    over: Hemispheres,
    draws: NDArray[np.float64],
    method: Method,
    known_open: NDArray[np.bool_] | None = None,
    bent: bool = False,
    errors: bool = True,
) -> Estimates:
    """w = 1/pi * integral of mu(d) cos(theta) over the hemisphere about the shading normal: 1 where open.

    A direction that points below the triangle it leaves is mirrored at that triangle's plane, so that no
    triangle shades itself.

    The default sampler is a golden-angle spiral on the disc, turned and phased per point: unbiased for any
    count, and within 6 to 16 % of the least error any point set can have on visibility. Every estimate is a
    function of its own row alone.

    Parameters
    ----------
    draws : (2, M) float64
        In [0, 1): turn and phase of each point's spiral, or what another sampler is scrambled by.
    known_open : (M,) bool, optional
        Points that are known to be open, which cast no ray.
    bent : bool
        Also the mean direction of what is open.
    errors : bool
        Also the unevenness, which `Errors` asks for; 0 otherwise.
    """
    count = len(over.n)
    w, uneven = np.ones(count, F), np.zeros(count, F)
    mean = np.array(over.n, F, order="F") if bent else None
    lane = np.flatnonzero(~known_open) if known_open is not None and known_open.any() else None
    casting = count if lane is None else len(lane)
    frames = about(over.n, draws, method)
    at_once = max(1, RAYS_AT_ONCE // method.samples)
    for first in range(0, casting, at_once):
        some = slice(first, min(first + at_once, casting))
        part = some if lane is None else lane[some]
        own = over.take(part)
        d = directions(frames[part], draws[:, part], method)
        if own.ng is not None:
            mirror_below(d, own, method)
        origins = own.origins if own.starts == 1 else take_rows(own.origins, own.of_rays(method.samples))
        mu = seen(tracer, origins, d, method).reshape(-1, method.samples)
        w[part] = shares(mu)
        if errors:
            uneven[part] = neighbor_variation(mu, method.sampler)
        if mean is not None:
            ways = d.T.reshape(3, len(mu), -1).transpose(1, 0, 2)
            towards = np.matmul(ways, mu.astype(F)[:, :, None])[:, :, 0]
            size = np.linalg.norm(towards, axis=1, keepdims=True)
            mean[part] = np.divide(towards, size, out=np.zeros_like(towards), where=size > 0)
    return Estimates(w, uneven, mean, count - casting)


def shares(mu: NDArray[Any]) -> NDArray[np.float32]:
    """(M,) mean of each row; 1 exactly where nothing is in the way."""
    if mu.dtype == np.bool_:  # exact: counts are below 2^24
        return (mu.astype(F) @ np.ones(mu.shape[1], F)) / F(mu.shape[1])
    return mu.mean(axis=1, dtype=np.float64).astype(F)


def neighbor_variation(mu: NDArray[Any], sampler: Sampler) -> NDArray[np.float32]:
    """(M,) how much mu changes between neighbouring rays, the sign by which the error of a set is known.

    On a golden-angle spiral points whose numbers differ by a Fibonacci number near sqrt(N) lie side by side.
    Their squared differences count how many cells edges of occluders cross, and those alone err. For other
    samplers N times the variance.
    """
    samples = mu.shape[1]
    if sampler != "spiral":
        mean = mu.mean(axis=1, dtype=np.float64)
        square = mean if mu.dtype == np.bool_ else np.square(mu, dtype=np.float64).mean(axis=1)
        return (samples * np.maximum(square - mean * mean, 0)).astype(F)
    total = np.zeros(len(mu), F)
    for step in neighbours(samples):
        if mu.dtype == np.bool_:
            total += np.count_nonzero(mu[:, step:] != mu[:, :-step], axis=1)
        else:
            total += np.square(mu[:, step:] - mu[:, :-step]).sum(axis=1)
    return total


def neighbours(samples: int) -> list[int]:
    """Two Fibonacci numbers in a row from 3/4 sqrt(samples) on, as far as there are so many rays."""
    a, b = 1, 2
    while a < 0.75 * samples**0.5:
        a, b = b, a + b
    return [step for step in (a, b) if step < samples]


def seen(tracer: Tracer, origins: Vectors, d: Vectors, method: Method) -> NDArray[Any]:
    """(M * samples,) mu along each direction: bool where it is a step, float32 elsewhere.

    There is an origin for every ray, or one for those of each point.
    """
    reach = method.falloff.reach(method.radius)
    if method.any_hit:
        return ~tracer.occluded(origins, d, np.inf if reach == np.inf else reach / method.radius)
    if method.faces == "count":
        far = tracer.distance(origins, d)
    else:
        each = len(d) // max(len(origins), 1)
        far = facing_distance(tracer, origins if each == 1 else repeat_rows(origins, each), d, method)
    weight = method.falloff.weight(far.astype(np.float64) * method.radius, reach, method.radius)
    return weight > 0.5 if method.falloff.step else weight.astype(F)


def facing_distance(tracer: Tracer, o: Vectors, d: Vectors, method: Method) -> Floats:
    """(R,) float32 distance to the first face that counts, inf where there is none.

    `one_sided`: a ray that first meets the back of a face ends there, unhindered. `ignore`: it goes on.
    """
    assert method.facets is not None
    far = np.full(len(o), np.inf, F)
    lane, start, passed = np.arange(len(o)), o, np.zeros(len(o), F)
    for _ in range(MOST_SHEETS):
        closest = tracer.closest(start, d[lane])
        hit = closest.triangle >= 0
        behind = hit & (dot(take_rows(method.facets, np.maximum(closest.triangle, 0)), d[lane]) > 0)
        front = hit & ~behind
        far[lane[front]] = passed[front] + closest.distance[front]
        if method.faces == "one_sided" or not behind.any():
            break
        # past the face by a few roundings of the coordinates, which are at most about 1
        step = closest.distance[behind] + F(4 * 2.0**-23)
        lane, passed = lane[behind], passed[behind] + step
        start = column_major(start[behind] + step[:, None] * d[lane], F)
    return far


def directions(frames: NDArray[np.float32], draws: NDArray[np.float64], method: Method) -> Vectors:
    """(M * samples, 3) float32 the rays of each point, one point after the other, from `about`."""
    out = np.empty((3, len(frames), method.samples), F)
    # a long row per component: three times as fast as one of three numbers per ray
    np.matmul(frames.transpose(0, 2, 1), patterns(draws, method), out=out.transpose(1, 0, 2))
    return out.reshape(3, -1).T


def mirror_below(d: Vectors, over: Hemispheres, method: Method) -> None:
    """Mirror those of the rays `d` that point below the plane of the triangle they leave, in place.

    Parameters
    ----------
    d : (M * samples, 3) float32
        The rays of each point, one point after the other.
    over : Hemispheres
        With the triangles' normals.
    """
    # the candidates of each point: of a pattern in the order of growing angles only the last
    assert over.ng is not None
    each = over.starts
    axes = over.n if each == 1 else repeat_rows(over.n, each)
    number = below_at_most(dot(axes, over.ng).reshape(-1, each).min(axis=1, initial=1), method)
    point = np.repeat(np.arange(len(over.n)), number)
    last = np.arange(len(point)) - np.repeat(np.cumsum(number) - number, number)
    ray = point * method.samples + method.samples - 1 - last
    start = point if each == 1 else point * each + (method.samples - 1 - last) * STRIDE % each

    # those that are below go as far above
    normal = take_rows(over.ng, start)
    height = dot(take_rows(d, ray), normal)
    below = np.flatnonzero(height < GRAZING)
    height, ray = height[below], ray[below]
    up = np.maximum(-height, F(GRAZING)) - height
    for component, along in zip(d.T, take_rows(normal, below).T, strict=True):
        component[ray] += up * along


def below_at_most(cosine: Floats, method: Method) -> NDArray[np.int64]:
    """(M,) how many rays, the last of each pattern, may point below a plane.

    Ray i of a spiral leaves the axis at sin^2 = (i + phase) / samples, and none points below a plane whose
    normal stands at t from the axis unless sin^2 > cos^2 t.

    Parameters
    ----------
    cosine : (M,) float32
        Of the angle between the pattern's axis and the plane's normal.
    """
    if method.sampler != "spiral":
        return np.full(len(cosine), method.samples)
    least = 1 / (4 * len(spiral_table(method.samples)))  # half of what the last phase leaves of the rim
    sine2 = 1 - np.square(np.clip(cosine, 0, 1).astype(np.float64)) + GRAZING
    return np.clip(np.ceil(sine2 * method.samples - least), 0, method.samples).astype(np.int64)


def patterns(draws: NDArray[np.float64], method: Method) -> NDArray[np.float32]:
    """(M, 3, samples) float32 cosine-weighted unit directions about the third axis."""
    if method.sampler == "spiral":
        table = spiral_table(method.samples)
        return table.take((draws[1] * len(table)).astype(np.int32), axis=0)
    seeds = (draws * 2.0**32).astype(np.uint32)
    if method.sampler == "owen":
        u, v = (
            owen(base[None, :], seed[:, None])
            for base, seed in zip(sobol(method.samples), seeds, strict=True)
        )
    else:
        ray = np.arange(method.samples, dtype=np.uint32)[None, :]
        u, v = (unit_interval(hashed(k, hashed(k + 7, seeds[k])[:, None] + ray)) for k in (0, 1))
    r, angle = np.sqrt(u), 2 * np.pi * v
    return np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1 - u)], axis=1).astype(F)


def about(n: Vectors, draws: NDArray[np.float64], method: Method) -> NDArray[np.float32]:
    """(M, 3, 3) float32 the axes of each point's pattern, as rows: spirals are turned."""
    angle = 2 * np.pi * draws[0] if method.sampler == "spiral" else np.zeros(len(n))
    return turned_frame(n, angle.astype(F))


def turned_frame(n: Vectors, angle: NDArray[np.float32]) -> NDArray[np.float32]:
    """(M, 3, 3) rows tangent, bitangent, normal; the tangent turned about `n` by `angle` [rad].

    References
    ----------
    Duff, T. et al. (2017). Building an orthonormal basis, revisited. JCGT 6(1).
    """
    x, y, z = n[:, 0], n[:, 1], n[:, 2]
    sign = np.copysign(F(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    c, s = np.cos(angle), np.sin(angle)
    frame = np.empty((len(n), 3, 3), F)
    t = (1 + sign * x * x * a, sign * b, -sign * x)
    u = (b, sign + y * y * a, -y)
    for k in range(3):
        frame[:, 0, k] = c * t[k] + s * u[k]
        frame[:, 1, k] = c * u[k] - s * t[k]
        frame[:, 2, k] = n[:, k]
    return frame


class Errors(Value):
    """The error law of a bake: standard error of w = sqrt(still + slope * unevenness) / samples.

    It is fitted to pairs of independent scrambles: half the squared difference of two estimates is an
    unbiased sight of their variance. `still` is what points err that saw no change at all.
    """

    still: float
    slope: float
    rmse: float  # root of the mean variance over the points that the pairs were drawn from
    pairs: int

    @classmethod
    def of_pairs(cls, a: Estimates, b: Estimates, samples: NDArray[Any] | int) -> Errors:
        """The law that fits K pairs of estimates, (K,) each, of independent scrambles."""
        if not len(a.w):
            return cls(0.0, 0.0, 0.0, 0)
        half = np.square(a.w.astype(np.float64) - b.w) / 2
        square = np.tile(half * np.square(samples, dtype=np.float64), 2)
        x = np.concatenate([a.neighbor_variation, b.neighbor_variation]).astype(np.float64)
        weight = 1 / np.square(1 + x)  # a variance is known in proportion to itself
        still, slope = _line(x, square, weight)
        # where no ray of any pair met anything, that is how little is known to be in the way
        least = (3 / 1.96 / (2 * len(a.w))) ** 2
        return cls(max(still, least), slope, float(np.sqrt(half.mean())), len(a.w))

    def at(self, neighbor_variation: Floats, samples: NDArray[Any] | int) -> NDArray[np.float32]:
        """(M,) standard error of each estimate."""
        square = self.still + self.slope * neighbor_variation.astype(np.float64)
        return (np.sqrt(square) / samples).astype(F)


def _line(x: Floats, y: Floats, weight: Floats) -> tuple[float, float]:
    """Weighted least squares of y = a + b x with neither below 0."""
    s, sx, sy, sxx, sxy = (float(np.sum(weight * v)) for v in (np.ones_like(x), x, y, x * x, x * y))
    wide = s * sxx - sx * sx
    slope = (s * sxy - sx * sy) / wide if wide > 1e-12 * s * sxx else 0.0
    start = (sy - slope * sx) / s
    if slope < 0:
        return sy / s, 0.0
    if start < 0:
        return 0.0, sxy / sxx
    return start, slope
