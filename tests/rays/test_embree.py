"""Closest hits and occlusion queries with known results, and wrong arguments that embreex would accept."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from illumcli.compiled import SWITCH
from illumcli.errors import IllumError
from illumcli.rays import embree_library as library
from illumcli.rays import embree_upload as upload
from illumcli.rays.embree import Interrupted, Tracer
from illumcli.rays.packet_loop import missing
from illumcli.rays.single_ray_loop import SingleRayLoop

F = np.float32
SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], F)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


LOOPS = ["0"] if missing() else ["0", "1"]


@pytest.fixture(scope="module", params=LOOPS, ids=["single rays", "packets"][: len(LOOPS)])
def square(request):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(SWITCH, request.param)
        return Tracer(SQUARE, FACES)


ULP = np.finfo(F).eps
"""Embree's kernels divide by an estimated reciprocal; instruction classes differ in the last bit."""


def rays(*pairs):
    o, d = np.array(pairs, F).transpose(1, 0, 2)
    return np.ascontiguousarray(o), np.ascontiguousarray(d)


def test_closest_names_triangle_weights_and_distance(square):
    o, d = rays(([0.5, -0.5, 2], [0, 0, -1]), ([3, 0, 2], [0, 0, -1]))
    hit = square.closest(o, d)
    assert hit.triangle.tolist() == [0, -1]
    np.testing.assert_allclose(hit.distance, [2, np.inf], rtol=ULP)
    corners = SQUARE[FACES[0]].astype(float)
    weights = np.array([1 - hit.u[0] - hit.v[0], hit.u[0], hit.v[0]])
    np.testing.assert_allclose(weights @ corners, [0.5, -0.5, 0], atol=1e-6)


def test_distance_agrees_with_closest(square):
    o, d = rays(([0.1, 0.2, 2], [0, 0, -1]), ([3, 0, 2], [0, 0, -1]))
    np.testing.assert_allclose(square.distance(o, d), [2, np.inf], rtol=ULP)


def test_occluded_within_the_limit_only(square):
    o, d = rays(*[([0.3, 0.1, 1], [0, 0, -1])] * 6)
    limits = np.array([0.5, 1.5, np.inf, 0, -1, -np.inf], F)
    assert square.occluded(o, d, limits).tolist() == [False, True, True, False, False, False]
    assert square.occluded(o[:1], d[:1], 0.5).tolist() == [False]
    assert square.occluded(o[:1], d[:1]).tolist() == [True]


def test_the_callers_arrays_stay_as_they_are(square):
    o, d = rays(([0.3, 0.1, 1], [0, 0, -1]))
    limits = np.array([7], F)
    copies = o.copy(), d.copy(), limits.copy()
    square.closest(o, d), square.distance(o, d), square.occluded(o, d, limits)
    for array, copy in zip((o, d, limits), copies, strict=True):
        assert array.tobytes() == copy.tobytes()


def test_strided_and_component_major_rays_are_the_same_rays(square):
    rng = np.random.default_rng(1)
    o = rng.normal(size=(200, 3)).astype(F)
    d = -o + rng.normal(size=(200, 3)).astype(F) * F(0.5)
    plain = square.closest(o, d)
    wide = np.zeros((400, 6), F)
    wide[::2, ::2] = o
    for other in (np.asfortranarray(o), wide[::2, ::2]):
        again = square.closest(other, np.asfortranarray(d))
        assert np.array_equal(plain.triangle, again.triangle)
        assert np.array_equal(plain.distance, again.distance)


def test_every_ray_at_a_vertex_of_a_closed_body_hits(ball):
    vertices, faces = ball
    tracer = Tracer(vertices.astype(F), faces)
    o = np.zeros((len(vertices), 3), F)
    d = vertices.astype(F)
    assert (tracer.closest(o, d).triangle >= 0).all()


def test_rays_are_counted_per_view(square):
    o, d = rays(([0.3, 0.1, 1], [0, 0, -1]))
    own = square.counting()
    own.occluded(o, d)
    own.distance(o, d)
    assert (own.rays, square.counting().rays) == (2, 0)


def test_once_stopped_every_question_ends(square):
    stop = threading.Event()
    own = square.counting(stop)
    o, d = rays(([0.3, 0.1, 1], [0, 0, -1]))
    own.occluded(o, d)
    stop.set()
    for question in (own.closest, own.distance, own.occluded):
        with pytest.raises(Interrupted):
            question(o, d)


def test_an_empty_scene_and_no_rays_are_answered():
    empty = Tracer(np.zeros((0, 3), F), np.zeros((0, 3), np.int32))
    o, d = rays(([0, 0, 1], [0, 0, -1]))
    assert empty.closest(o, d).triangle.tolist() == [-1]
    assert empty.occluded(o, d).tolist() == [False]
    none = np.zeros((0, 3), F)
    assert len(empty.closest(none, none).triangle) == 0
    assert len(empty.occluded(none, none)) == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("which", [0, 1])
def test_rays_that_are_not_finite_never_reach_embree(square, value, which):
    pair = list(rays(([0.3, 0.1, 1], [0, 0, -1]), ([0, 0, 1], [0, 0, -1])))
    pair[which][1, 2] = value
    with pytest.raises(IllumError, match="1 of 2 rays"):
        square.closest(*pair)


def test_an_origin_stands_for_several_rays_in_a_row(ball):
    vertices, faces = ball
    tracer = Tracer(vertices.astype(F), faces)
    rng = np.random.default_rng(5)
    o, d = rng.normal(size=(50, 3)).astype(F), rng.normal(size=(350, 3)).astype(F)
    each = np.repeat(o, 7, axis=0)
    assert np.array_equal(tracer.occluded(o, d, 2.0), tracer.occluded(each, d, 2.0))
    assert np.array_equal(tracer.distance(o, d), tracer.distance(each, d))
    assert np.array_equal(tracer.closest(o, d).triangle, tracer.closest(each, d).triangle)
    assert tracer.occluded(o, d, 2.0).mean() > 0.05


def test_a_limit_that_is_not_a_number_is_refused(square):
    o, d = rays(([0.3, 0.1, 1], [0, 0, -1]))
    with pytest.raises(IllumError, match="not a number"):
        square.occluded(o, d, np.array([np.nan], F))


shapes = st.sampled_from([(4, 3), (4, 2), (3,), (2, 3), (0, 3), (1, 3), (4, 4), (4, 3, 1)])
dtypes = st.sampled_from([np.float32, np.float64, np.int32, np.float16])


@settings(max_examples=300, deadline=None)
@given(shapes, shapes, st.sampled_from([(4,), (3,), (0,), (1,), ()]), dtypes, dtypes)
def test_no_arrays_crash_it(o_shape, d_shape, limit_shape, o_type, d_type):
    tracer = Tracer(SQUARE, FACES)
    o, d, limits = np.ones(o_shape, o_type), np.ones(d_shape, d_type), np.ones(limit_shape, F)
    fits = o.ndim == d.ndim == 2 and o.shape[1] == d.shape[1] == 3 and {o.dtype, d.dtype} == {np.dtype(F)}
    fits = fits and (len(o) == len(d) or (0 < len(o) < len(d) and len(d) % len(o) == 0))
    if fits and limits.shape in ((len(d),), ()):
        assert len(tracer.occluded(o, d, limits)) == len(d)
    else:
        with pytest.raises(ValueError, match=r"must be|for"):
            tracer.occluded(o, d, limits)


def test_upload_answers_as_embreex_own_mesh_does(ball, monkeypatch):
    vertices, faces = ball
    rng = np.random.default_rng(8)
    o = rng.uniform(-2, 2, (5000, 3)).astype(F)
    d = (rng.uniform(-1, 1, (5000, 3)) - o).astype(F)
    shared = SingleRayLoop(vertices.astype(F), faces).closest(o, d)
    monkeypatch.setattr(upload, "embree_library", lambda: None)
    own = SingleRayLoop(vertices.astype(F), faces).closest(o, d)
    for name in ("triangle", "u", "v", "distance"):
        assert getattr(shared, name).tobytes() == getattr(own, name).tobytes()


def test_upload_knows_its_place_in_memory():
    from embreex.rtcore_scene import EmbreeScene

    assert upload._handle(EmbreeScene(robust=True))
    assert upload._handle(Elsewhere()) is None


def test_upload_builds_the_tree(ball):
    from embreex.rtcore_scene import EmbreeScene

    vertices, faces = ball
    scene = EmbreeScene(robust=True)
    upload.upload(scene, vertices.astype(F), faces)
    assert scene.is_committed


@pytest.mark.parametrize(("code", "error"), [(1, IllumError), (library.OUT_OF_MEMORY, MemoryError)])
@pytest.mark.parametrize("switch", LOOPS)
def test_a_tree_that_cannot_be_built_is_told(ball, monkeypatch, code, error, switch):
    vertices, faces = ball
    monkeypatch.setenv(SWITCH, switch)
    missing()  # asks a device of its own
    monkeypatch.setattr(library.embree_library(), "rtcGetDeviceError", lambda device: code)
    with pytest.raises(error) as caught:
        Tracer(vertices.astype(F), faces)
    assert ("its tree: error 1" in str(caught.value)) == (code == 1)


class Elsewhere:
    """A scene of another layout."""

    is_committed = 0


@pytest.mark.parametrize("paths", [[], ["libembree4-a.so", "libembree4-b.so"], ["missing.so"]])
def test_a_library_that_is_not_there_once_is_not_used(paths, monkeypatch):
    monkeypatch.setattr(library, "_paths", lambda: iter(paths))
    assert library.embree_library.__wrapped__() is None


@pytest.mark.parametrize("switch", LOOPS)
def test_there_may_be_thousands_of_tracers_at_a_time(switch, monkeypatch):
    monkeypatch.setenv(SWITCH, switch)
    tracers = [Tracer(SQUARE + F(number), FACES) for number in range(2000)]
    for number in (0, 1023, 1999):
        o, d = rays(([number + 0.3, number + 0.1, number + 1], [0, 0, -1]))
        assert tracers[number].closest(o, d).triangle.tolist() == [0]
