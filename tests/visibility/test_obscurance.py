"""w against closed forms, on real geometry, judged by its own spread over scrambles."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.compiled import SWITCH
from illumcli.rays.embree import Tracer
from illumcli.rays.offsets import offset_ray_origins
from illumcli.rays.packet_loop import missing
from illumcli.schema.families import members
from illumcli.visibility.falloffs.exponential import Exponential
from illumcli.visibility.falloffs.step import Step
from illumcli.visibility.hemisphere import Hemispheres, turned_frame
from illumcli.visibility.obscurance import Method
from illumcli.visibility.obscurance import estimates as estimated
from illumcli.visibility.samplers import SAMPLERS

F = np.float32
FLOOR = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
UP = np.array([0.0, 0.0, 1.0])


def scene(*quads):
    vertices = np.concatenate(quads)
    faces = [
        [4 * k + a, 4 * k + b, 4 * k + c] for k in range(len(quads)) for a, b, c in ((0, 1, 2), (0, 2, 3))
    ]
    return Tracer(vertices.astype(F), np.array(faces, np.int32))


def sphere(rings=96, sectors=192):
    """A fine sphere of radius 1 as a grid of latitude and longitude, facing inwards."""
    theta = np.linspace(0, np.pi, rings + 1)
    phi = np.linspace(0, 2 * np.pi, sectors + 1)
    t, f = np.meshgrid(theta, phi, indexing="ij")
    v = np.stack([np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)], axis=-1).reshape(-1, 3)
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rings), np.arange(sectors), indexing="ij"))
    a, b = i * (sectors + 1) + j, (i + 1) * (sectors + 1) + j
    return v, np.concatenate([np.stack([a, b, a + 1], 1), np.stack([b, b + 1, a + 1], 1)]).astype(np.int32)


def obscurance(tracer, origins, ng, draws, method):
    return estimated(tracer, Hemispheres(ng, origins), draws, method, errors=False).w


def estimates(tracer, point, normal, falloff, samples=64, scrambles=400, radius=1.0):
    rng = np.random.default_rng(11)
    p = np.tile(np.asarray(point, float), (scrambles, 1))
    n = np.tile(np.asarray(normal, F), (scrambles, 1))
    origins = offset_ray_origins(p, n, np.full(scrambles, F(3)))
    return obscurance(tracer, origins, n, rng.random((2, scrambles)), Method(samples, falloff, radius))


def agrees(w, exact):
    error = w.std(ddof=1) / len(w) ** 0.5
    assert abs(w.mean() - exact) < 4.5 * max(error, 1e-6), (w.mean(), exact, error)


def test_a_lone_plane_is_open_exactly():
    w = estimates(scene(FLOOR), [0.2, 0.1, 0], UP, Step())
    assert (w == 1).all()


@pytest.mark.parametrize(("away", "height"), [(0.1, 0.2), (0.02, 0.5), (0.3, 0.05)])
def test_floor_beside_a_long_wall(away, height):
    wall = np.array([[away, -500, 0], [away, 500, 0], [away, 500, height], [away, -500, height]])
    w = estimates(scene(FLOOR * 500, wall), [0, 0, 0], UP, Step())
    agrees(w.astype(float), (1 + away / np.hypot(away, height)) / 2)


def test_a_plate_out_of_reach_does_not_count_and_one_within_does():
    plate = FLOOR * 400 + [0, 0, 0.1]
    tracer = scene(FLOOR, plate)
    assert (estimates(tracer, [0, 0, 0], UP, Step(max_distance=0.09)) == 1).all()
    w = estimates(tracer, [0, 0, 0], UP, Step(max_distance=0.2)).astype(float)
    agrees(w, (0.1 / 0.2) ** 2)
    relative = estimates(tracer, [0, 0, 0], UP, Step(max_distance="0.2r"), radius=5.0).astype(float)
    agrees(relative, (0.1 / 0.2) ** 2)


def test_exponential_inside_a_sphere():
    vertices, faces = sphere()
    tau, radius = 0.7, 1.0
    tracer = Tracer(vertices.astype(F), faces)
    inward = -vertices[faces[7000]].mean(axis=0)
    point, normal = -inward, inward / np.linalg.norm(inward)
    w = estimates(tracer, point, normal, Exponential(falloff="exponential", tau=tau)).astype(float)
    kappa = 2 * tau * radius
    exact = 1 - 2 / kappa**2 * (1 - (1 + kappa) * np.exp(-kappa))
    # the faceted ball is up to 0.05 % smaller than the sphere
    assert abs(w.mean() - exact) < 4.5 * w.std() / 20 + 1e-3


def test_the_error_falls_like_that_of_well_spread_points():
    wall = np.array([[0.1, -500, 0], [0.1, 500, 0], [0.1, 500, 0.2], [0.1, -500, 0.2]])
    tracer = scene(FLOOR * 500, wall)
    counts = np.array([16, 64, 256, 1024])
    spread = [estimates(tracer, [0, 0, 0], UP, Step(), n, 600).astype(float).std() for n in counts]
    assert np.polyfit(np.log(counts), np.log(spread), 1)[0] < -0.65


def test_points_do_not_depend_on_their_company():
    plate = FLOOR * 0.3 + [0, 0, 0.1]
    tracer = scene(FLOOR, plate)
    rng = np.random.default_rng(2)
    p = np.column_stack([rng.uniform(-0.5, 0.5, (1000, 2)), np.zeros(1000)])
    n, draws = np.tile(UP.astype(F), (1000, 1)), rng.random((2, 1000))
    origins = offset_ray_origins(p, n, np.full(1000, F(3)))
    whole = obscurance(tracer, origins, n, draws, Method(48, Step(), 1.0))
    part = obscurance(tracer, origins[300:317], n[300:317], draws[:, 300:317], Method(48, Step(), 1.0))
    assert np.array_equal(whole[300:317], part)


def test_frames_are_orthonormal_for_every_normal():
    rng = np.random.default_rng(4)
    n = rng.normal(size=(1000, 3))
    n[:6] = [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0], [1e-8, 0, -1], [0, 1e-8, 1]]
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(F)
    frame = turned_frame(n, rng.uniform(0, 7, 1000).astype(F))
    np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), np.tile(np.eye(3), (1000, 1, 1)), atol=1e-6)
    assert np.array_equal(frame[:, 2], n)


@pytest.mark.parametrize("Falloff", members("illumcli.visibility.falloffs"), ids=lambda c: c.__name__)
def test_occluders_out_of_reach_weigh_nothing_exactly(Falloff):
    """Rays end a little beyond the reach, and distances are rounded."""
    tag = Falloff.__module__.rpartition(".")[2]
    under_a_lid = scene(FLOOR, 100 * FLOOR[::-1] + [0, 0, 1])
    for radius in np.random.default_rng(4).uniform(0.1, 10, 20):
        falloff = Falloff.model_validate({"falloff": tag, "max_distance": 0.99 * radius})
        w = estimates(under_a_lid, [0, 0, 0], UP, falloff, scrambles=10, radius=radius)
        assert (w == 1).all()


@pytest.mark.parametrize("Falloff", members("illumcli.visibility.falloffs"), ids=lambda c: c.__name__)
def test_every_falloff_rises_from_0_at_contact_to_1_out_of_reach(Falloff):
    tag = Falloff.__module__.rpartition(".")[2]
    falloff = Falloff.model_validate({"falloff": tag, "max_distance": 2.0})
    x = np.array([0, 1e-9, 0.1, 0.5, 1, 1.9, 2, 3, np.inf])
    for dtype in (np.float32, np.float64):
        mu = falloff.weight(x.astype(dtype), falloff.reach(1.0), 1.0)
        assert mu.dtype == dtype
        assert (np.diff(mu) >= 0).all()
        assert mu[0] == 0
        assert (mu[x >= 2] == 1).all()


def tilted(tracer, tilts, sampler="spiral", samples=64, scrambles=400, bent=False):
    """Estimates at the origin of a floor about normals that lean by `tilts` [degrees] towards -x."""
    rng = np.random.default_rng(12)
    t = np.radians(np.broadcast_to(tilts, scrambles))
    n = np.asfortranarray(np.stack([-np.sin(t), 0 * t, np.cos(t)], axis=1).astype(F))
    ng = np.asfortranarray(np.tile(UP.astype(F), (scrambles, 1)))
    over = Hemispheres(n, offset_ray_origins(np.zeros((scrambles, 3)), ng, np.full(scrambles, F(3))), ng)
    return estimated(
        tracer, over, rng.random((2, scrambles)), Method(samples, Step(), 1.0, sampler), bent=bent
    )


@pytest.mark.parametrize("tilt", [-60, -20, -1, 3, 35, 80])
@pytest.mark.parametrize("sampler", ["spiral", "owen", "random"])
def test_tilted_hemisphere_at_the_foot_of_an_endless_wall(tilt, sampler):
    """Of the angles in the plane across the edge, seen from n, the wall covers those from t to 90 degrees,
    (1 - sin t) / 2 of the cosine; what points below the floor is mirrored on its own side of the normal."""
    wall = np.array([[1e-3, -500, 0], [1e-3, 500, 0], [1e-3, 500, 500], [1e-3, -500, 500]])
    w = tilted(scene(FLOOR * 500, wall), tilt, sampler).w.astype(float)
    agrees(w, (1 + np.sin(np.radians(tilt))) / 2)


@pytest.mark.parametrize("samples", [1, 7, 64, 1024])
@pytest.mark.parametrize("sampler", ["spiral", "owen", "random"])
def test_a_lone_plane_is_open_exactly_about_any_normal(samples, sampler):
    tilts = np.concatenate([np.linspace(0, 180, 100), np.geomspace(1e-6, 1, 100)])
    assert (tilted(scene(FLOOR), tilts, sampler, samples, 200).w == 1).all()


def test_only_rays_below_the_triangle_are_mirrored():
    found = tilted(scene(FLOOR), 40, samples=4096, scrambles=50, bent=True)
    mean = found.bent.astype(float)
    assert (mean[:, 2] > np.cos(np.radians(40))).all()  # what was below has come above
    straight = tilted(scene(FLOOR), 0, samples=4096, scrambles=50, bent=True).bent.astype(float)
    assert np.abs(straight - UP).max() < 0.01


def test_tilted_points_do_not_depend_on_their_company():
    tracer = scene(FLOOR, FLOOR * 0.3 + [0, 0, 0.1])
    tilts = np.linspace(0, 70, 400)
    whole, draws = tilted(tracer, tilts).w, np.random.default_rng(12).random((2, 400))
    t = np.radians(tilts)
    n = np.asfortranarray(np.stack([-np.sin(t), 0 * t, np.cos(t)], axis=1).astype(F))
    ng = np.asfortranarray(np.tile(UP.astype(F), (400, 1)))
    over = Hemispheres(n, offset_ray_origins(np.zeros((400, 3)), ng, np.full(400, F(3))), ng).between(
        120, 133
    )
    assert np.array_equal(
        whole[120:133], estimated(tracer, over, draws[:, 120:133], Method(64, Step(), 1.0)).w
    )


@pytest.mark.skipif(missing() is not None, reason="needs the loop over packets")
@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("falloff", [Step(), Exponential(falloff="exponential", tau=2.0)])
@pytest.mark.parametrize("faces", ["count", "ignore", "one_sided"])
def test_packets_and_single_rays_estimate_the_same_bits(sampler, falloff, faces, monkeypatch):
    vertices, triangles = sphere(12, 24)
    walls = np.concatenate([vertices, 0.5 * vertices + [0, 0, 0.6]]).astype(F)
    triangles = np.concatenate([triangles, triangles + len(vertices)])
    a, b, c = (walls[triangles[:, k]].astype(float) for k in range(3))
    ng = np.cross(b - a, c - a)
    has_area = np.linalg.norm(ng, axis=1) > 1e-9
    a, b, c, ng = (each[has_area] for each in (a, b, c, ng))
    ng = (ng / np.linalg.norm(ng, axis=1, keepdims=True)).astype(F)
    origins = offset_ray_origins((a + b + c) / 3, ng, np.full(len(a), F(1)))
    rng = np.random.default_rng(6)
    tilted = ng + rng.normal(size=ng.shape) * 0.3
    tilted = (tilted / np.linalg.norm(tilted, axis=1, keepdims=True)).astype(F)
    over = Hemispheres(tilted, origins, ng, rng.random(len(a)) < 0.1)
    draws = rng.random((2, len(a)))
    normals = np.zeros((len(triangles), 3), F)
    normals[has_area] = np.where(rng.random((len(a), 1)) < 0.5, ng, -ng)  # of either side
    method = Method(40, falloff, 1.0, sampler, faces, normals)
    found = []
    for switch in ("0", "1"):
        monkeypatch.setenv(SWITCH, switch)
        tracer = Tracer(walls, triangles)
        found.append(estimated(tracer, over, draws, method, bent=True))
        counted = estimated(tracer, over, draws, method, errors=False)
        assert counted.w.tobytes() == found[0].w.tobytes()
    single, packets = found
    assert 0.1 < single.w.mean() < 0.99
    for name in ("w", "neighbor_variation", "bent"):
        assert getattr(single, name).tobytes() == getattr(packets, name).tobytes()
