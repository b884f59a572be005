"""The generator: closed forms, what it conserves, and distributions as formulas, tables and drawings."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from illumcli.errors import InputError
from illumcli.images.drawings import read_numbers
from illumcli.models._terms import Components
from illumcli.models.cook_torrance import CookTorrance
from illumcli.models.generated import Generated
from illumcli.shading.terms import evaluate

THETA, PHI = (
    grid.ravel() for grid in np.meshgrid(np.linspace(0.003, np.pi / 2 - 1e-3, 60), np.linspace(-3.1, 3.1, 23))
)
ALONG = Components(np.sin(THETA) * np.cos(PHI), np.sin(THETA) * np.sin(PHI), np.cos(THETA))
SLANTED = {"n": [0, 0, 1], "l": [1, 0.3, 1], "v": [-0.2, -0.6, 1], "t": [1, 0, 0]}


def generated(**distribution):
    """All light is reflected by facets, which are perfect mirrors."""
    keys = {"distribution": distribution, "specular_weight": 1.0, "fresnel": {"F": "constant"}}
    return Generated.model_validate(keys).prepared(read_numbers)


@cache
def by_formula(text):
    return generated(p="formula", formula=text)


def written(path, pixels):
    """An image of (H, W, C) numbers, floats or integers."""
    pixels = np.ascontiguousarray(pixels)
    out = oiio.ImageOutput.create(str(path))
    out.open(str(path), oiio.ImageSpec(*pixels.shape[1::-1], pixels.shape[2], str(pixels.dtype)))
    out.write_image(pixels)
    out.close()
    return str(path)


def area(model, along=ALONG):
    return model.distribution.area.of_direction(along)


def beckmann_area(alpha):
    """n.k (1 + Lambda), Lambda of a roughness that k sees (Walter et al. 2007)."""
    a = ALONG.n / alpha
    erf = np.vectorize(math.erf)
    return ALONG.n * (1 + (erf(a) - 1) / 2 + np.exp(-a * a) / (2 * a * np.sqrt(np.pi)))


def seen_roughness(along, across):
    return np.hypot(along * ALONG.t, across * ALONG.b)


# --- closed forms ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("m", [1e-3, 0.3, 3.0])
def test_beckmann_has_the_projected_area_of_smith(m):
    surface = by_formula(f"exp(-(slope / {m})**2) / hn**4").distribution
    np.testing.assert_allclose(surface.area.of_angle(ALONG.n), beckmann_area(m * np.sin(THETA)), rtol=1e-8)
    assert surface.seen == pytest.approx(np.pi * m * m, rel=1e-12)


@pytest.mark.parametrize("widths", [(0.3, 0.3), (0.1, 0.5), (0.01, 1.0)])
def test_stretched_ggx_and_beckmann_have_the_projected_area_of_smith(widths):
    c, d = widths
    ggx = by_formula(f"((ht / {c})**2 + (hb / {d})**2 + hn**2)**(-2)")
    expected = (ALONG.n + np.sqrt(ALONG.n**2 + seen_roughness(c, d) ** 2)) / 2
    np.testing.assert_allclose(area(ggx), expected, rtol=1e-4)
    beckmann = by_formula(f"exp(-(x / {c})**2 - (y / {d})**2) / hn**4")
    np.testing.assert_allclose(area(beckmann), beckmann_area(seen_roughness(c, d)), rtol=1e-4)


def test_the_estimated_error_holds():
    for c, d in ((0.3, 0.3), (0.1, 0.5), (0.01, 1.0)):
        surface = by_formula(f"((ht / {c})**2 + (hb / {d})**2 + hn**2)**(-2)").distribution
        expected = (ALONG.n + np.sqrt(ALONG.n**2 + seen_roughness(c, d) ** 2)) / 2
        assert np.abs(surface.area.of_direction(ALONG) / expected - 1).max() <= surface.area.error


@pytest.mark.parametrize(
    ("formula", "D"),
    [
        ("exp(-(slope / 0.3)**2) / hn**4", {"D": "beckmann", "m": 0.3}),
        ("(0.04 * hn**2 + sin(theta)**2)**(-2)", {"D": "ggx", "alpha": 0.2}),
        ("hn**20", {"D": "power", "exponent": 20}),
    ],
)
def test_it_is_cook_torrance_with_smiths_separable_masking(formula, D, respond):
    model = by_formula(formula)
    keys = {"distribution": D, "masking": "smith", "specular_weight": 1, "fresnel": {"F": "constant"}}
    expected = respond(CookTorrance.model_validate(keys), SLANTED)
    np.testing.assert_allclose(respond(model, SLANTED), expected, rtol=1e-7)


def test_facets_of_all_directions_alike_have_half_a_mean_cosine():
    surface = by_formula("7").distribution
    assert surface.mean_cosine == pytest.approx(0.5, rel=1e-12)
    np.testing.assert_allclose(surface.area.of_angle(ALONG.n), (1 + ALONG.n) / 2, rtol=1e-9)


def test_a_formula_of_x_and_y_is_the_same_as_one_of_theta():
    around = by_formula("exp(-(slope / 0.4)**2) / hn**4")
    both = by_formula("exp(-(x*x + y*y) / 0.16) / hn**4")
    assert (around.has_grain(), both.has_grain()) == (False, True)
    np.testing.assert_allclose(area(both), around.distribution.area.of_angle(ALONG.n), rtol=1e-5)


# --- promises, for random distributions --------------------------------------------------------------------

place = st.floats(-0.8, 0.8)
lobes = st.lists(
    st.tuples(place, place, st.floats(0.15, 1), st.floats(0.15, 1), st.floats(0.1, 1)), min_size=1, max_size=3
)


def mixture(parts):
    """Lobes in the plane of leans: places, widths and weights; in general the facets lean on the whole."""
    each = (f"{w}*exp(-((x - ({a})) / {c})**2 - ((y - ({b})) / {d})**2)" for a, b, c, d, w in parts)
    return f"({' + '.join(each)} + 1e-4*exp(-(x*x + y*y) / 4)) / hn**4"


@settings(max_examples=8, deadline=None)
@given(
    parts=lobes,
    angle=st.floats(0, 85),
    turn=st.floats(0, 360),
    l=st.tuples(*[st.floats(-2, 2)] * 2, st.floats(0.1, 2)),
    v=st.tuples(*[st.floats(-2, 2)] * 2, st.floats(0.1, 2)),
)
def test_light_is_not_gained_and_may_go_either_way_whatever_the_distribution(parts, angle, turn, l, v, brdf):
    model = by_formula(mixture(parts))
    assert 0.05 < albedo(model, np.radians(angle), np.radians(turn)) <= 1 + 2e-3

    one = brdf(model, {"n": [0, 0, 1], "t": [1, 0, 0], "l": l, "v": v})
    np.testing.assert_allclose(one, brdf(model, {"n": [0, 0, 1], "t": [1, 0, 0], "l": v, "v": l}), rtol=1e-9)


def albedo(model, angle, turn, count=400):
    """The share of light from a direction that is reflected, by an integral over the leans of facets."""
    # Equal steps of u, lean = u / (1 - |u|) in either direction.
    u = (np.arange(count) + 0.5) * 2 / count - 1
    lean, step = u / (1 - np.abs(u)), (2 / count) / (1 - np.abs(u)) ** 2
    x, y = (grid.ravel() for grid in np.meshgrid(lean, lean))
    size = 1 / np.sqrt(1 + x * x + y * y)
    h = np.stack([x * size, y * size, size], axis=1)
    solid = np.outer(step, step).ravel() * size**3
    l = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])

    # dv = 4 (h.l) dh.
    cosine = h @ l
    v = 2 * cosine[:, None] * h - l
    lit = (cosine > 0) & (v[:, 2] > 0)
    vectors = {"n": [0.0, 0.0, 1.0], "t": [1.0, 0.0, 0.0], "l": l}
    given = {name: np.asfortranarray(np.tile(each, (lit.sum(), 1))) for name, each in vectors.items()}
    given |= {"v": np.asfortranarray(v[lit])}
    response = sum(evaluate(model.lobes(), given).values())[:, 0]
    # By reciprocity the same share leaves towards l: the response from v to l has the cosine of v.
    return float((response / l[2] * v[lit, 2] * 4 * cosine[lit] * solid[lit]).sum())


def test_the_bound_is_needed_where_facets_lean_on_the_whole():
    """Without it more of the facets would be seen than there are."""
    leaning = by_formula("exp(-((x - 0.5) / 0.2)**2 - (y / 0.2)**2) / hn**4")
    across = Components(*(np.array([each]) for each in (-0.6, 0.0, 0.8)))
    assert area(leaning, across)[0] == pytest.approx(0.8, rel=1e-12)
    free = leaning.distribution.area
    u = 0.8 / (0.8 + np.hypot(*(np.array([[free.stretch[0]], [free.stretch[1]]]) * -0.6)))
    assert np.interp(u, np.linspace(0, 1, free.table.shape[1]), free.table[64])[0] * 0.8 / u[0] < 0.6


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_a_factor_changes_nothing(factor, respond):
    one = respond(by_formula("exp(-(x / 0.3)**2 - y*y) / hn**4"), SLANTED)
    other = respond(by_formula(f"{factor} * exp(-(x / 0.3)**2 - y*y) / hn**4"), SLANTED)
    np.testing.assert_allclose(other, one, rtol=1e-12)


# --- tables ----------------------------------------------------------------------------------------------


def profile(path, rows, head="theta, p\n"):
    path.write_text(head + "".join(f"{', '.join(map(str, row))}\n" for row in rows))
    return str(path)


def test_a_profile_is_linear_between_its_rows(tmp_path, respond):
    file = profile(tmp_path / "p.csv", [(40, 0), (0, 2), (10, 1)])
    ramp = "max(0, max(2 - theta / (pi / 18), (40 - theta * 180 / pi) / 30))"
    np.testing.assert_allclose(
        respond(generated(p="profile", file=file), SLANTED), respond(by_formula(ramp), SLANTED), rtol=1e-9
    )


def test_a_table_of_phi_is_mirrored_as_in_photometric_files(tmp_path):
    rows = [(0, 3, 3, 3), (30, 2, 1, 0.5), (60, 0, 0, 0)]
    quarter = profile(tmp_path / "q.csv", rows, "theta, 0, 30, 90\n")
    whole = [(t, a, b, c, b, a, b, c, b) for t, a, b, c in rows]
    full = profile(tmp_path / "f.csv", whole, "theta; 0; 30; 90; 150; 180; 210; 270; 330\n".replace(";", ","))
    h = np.stack([ALONG.t, ALONG.b, ALONG.n])
    one, other = (generated(p="table", file=file).distribution for file in (quarter, full))
    np.testing.assert_allclose(one.normalised(h), other.normalised(h), rtol=1e-9)
    at = one.density.value(np.array([[np.sin(0.5)], [0], [np.cos(0.5)]]))
    assert at[0] == pytest.approx(3 - 0.5 / np.radians(30))


def test_negative_values_of_tables_are_counted(tmp_path):
    file = profile(tmp_path / "p.csv", [(0, 2), (10, -1), (20, "nan"), (30, 0)])
    model = generated(p="profile", file=file)
    assert list(model.repairs().values()) == [2]


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("", "has no rows"),
        ("0 1\n", "has one column"),
        ("theta, p\n0, 1\n", "has 1 rows"),
        ("theta, p\n0, 1\n5, x\n", r"p\.csv:3: 'x' is no number"),
        ("theta, p\n0, 1\n5\n", r"p\.csv:3: has 1 columns"),
        ("theta, p\n0, 1\n95, 1\n", r"p\.csv:3: theta must be 0 to 90 degrees, is 95"),
        ("theta, p\n5, 1\n5, 1\n", r"p\.csv:3: theta 5 is there twice"),
        ("theta, p\n0, 0\n5, 0\n", "p is 0 everywhere"),
        ("theta, 0, 90\n0, 1, 1\n5, 1, 2\n", "write p: table"),
    ],
)
def test_other_tables_are_refused(tmp_path, text, fact):
    path = tmp_path / "p.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=fact):
        generated(p="profile", file=str(path))


# --- drawings --------------------------------------------------------------------------------------------


def drawn(function, span, side=128):
    """(side, side, 1) float32 of a function of leans, the first row on top."""
    x = ((np.arange(side) + 0.5) * 2 / side - 1) * span
    return function(x[None, :], -x[:, None])[..., None].astype(np.float32)


def test_a_drawing_of_slopes_is_a_share_of_the_surface(tmp_path, respond):
    pixels = drawn(lambda x, y: np.exp(-(((x - 0.3) / 0.2) ** 2) - ((y + 0.1) / 0.4) ** 2), 2.0, 256)
    file = written(tmp_path / "s.exr", pixels)
    formula = by_formula("exp(-((x - 0.3) / 0.2)**2 - ((y + 0.1) / 0.4)**2) / hn**4")
    both = {"l": [1, -0.8, 1], "v": [-0.5, 0.4, 1]}
    np.testing.assert_allclose(
        respond(generated(p="slopes", file=file, range=2.0), SLANTED | both),
        respond(formula, SLANTED | both),
        rtol=2e-3,
    )


def test_a_drawing_of_the_disc_is_p_itself(tmp_path, respond):
    pixels = drawn(lambda x, y: np.exp(-(((x - 0.2) / 0.3) ** 2) - (y / 0.5) ** 2), 1.0, 256)
    file = written(tmp_path / "d.exr", pixels)
    formula = by_formula("exp(-((ht - 0.2) / 0.3)**2 - (hb / 0.5)**2)")
    np.testing.assert_allclose(
        respond(generated(p="disc", file=file), SLANTED), respond(formula, SLANTED), rtol=2e-3
    )


def test_the_colour_of_a_drawing_is_that_of_its_facets(tmp_path, respond):
    grey = np.full((8, 8, 3), 200, np.uint8)
    red = grey * np.array([1, 0.5, 0], np.float32)
    plain, colored = (
        respond(generated(p="disc", file=written(tmp_path / name, each.astype(np.uint8))), SLANTED)
        for name, each in (("grey.png", grey), ("red.png", red))
    )
    np.testing.assert_allclose(colored, plain * [1, 0.5, 0], rtol=1e-6)


def test_what_is_transparent_has_no_facets(tmp_path):
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[:, :2, 3] = 0
    numbers = read_numbers(written(tmp_path / "half.png", pixels))
    assert not numbers[:, :2].any()
    assert (numbers[:, 2:] == 1).all()


@pytest.mark.parametrize("side", [1, 3, 700])
def test_drawings_of_any_size_are_read(tmp_path, side):
    """An even square of leans, -1 to 1 either way: its projected area is 1 to 45 degrees."""
    model = generated(p="slopes", file=written(tmp_path / "s.exr", np.ones((side, side, 1), np.float32)))
    steep = Components(*(np.array([each]) for each in (1.0, 0.0, 0.0)))
    assert area(model, steep)[0] == pytest.approx(0.25, rel=2e-3)
    assert model.distribution.normalised(np.array([[0.0], [0.0], [1.0]]))[0] == pytest.approx(0.25, rel=2e-3)


def test_negative_numbers_of_drawings_are_counted(tmp_path):
    pixels = np.ones((4, 4, 1), np.float32)
    pixels[1, 2] = -1
    assert sum(generated(p="disc", file=written(tmp_path / "n.exr", pixels)).repairs().values()) == 3


@pytest.mark.parametrize(
    ("pixels", "fact"),
    [(np.zeros((4, 4, 1), np.float32), "is black"), (np.ones((4, 6, 1), np.float32), "must be square")],
)
def test_other_drawings_are_refused(tmp_path, pixels, fact):
    with pytest.raises(InputError, match=fact):
        generated(p="disc", file=written(tmp_path / "other.exr", pixels))


@pytest.mark.parametrize(
    ("formula", "fact"),
    [
        ("1 - theta", "is -0.0.* at theta = 1.0"),
        ("1 / max(0, theta - 1)", "is inf at theta"),
        ("max(0, theta - 2)", "has no facets"),
        ("50%", "'%' is not part of a formula"),
        ("exp(-r)", "unknown name 'r'; there are: theta, phi, slope, x, y"),
    ],
)
def test_formulas_that_are_no_density_are_refused(formula, fact):
    with pytest.raises(ValueError, match=fact):
        by_formula(formula)
