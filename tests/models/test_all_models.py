"""What every illumination model promises, for random parameters within their ranges."""

from __future__ import annotations

import ast
import functools
import inspect
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss

import rgl_files
from illumcli.arrays import column_major, cross, dot
from illumcli.commands.schema_generator import schema_of
from illumcli.images.drawings import read_numbers
from illumcli.measured_files import merl
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import may_vary
from illumcli.schema.description import nested, parts_of
from illumcli.schema.families import member, members
from illumcli.schema.sources import tags
from illumcli.shading.batches import batches
from illumcli.shading.terms import evaluate, given_terms
from illumcli.verification.claims import directions, turned

MODELS = members("illumcli.models")
WHOLE = [Model for Model in MODELS if not any(each.is_required() for each in Model.model_fields.values())]
"""Models whose parameters all have defaults: neither measurements nor formulas."""
FORMULAS = (
    "n_l * kd / (pi + m)",
    "n_l * (kd / pi + (1 - n_v)**m)",
    "kd * max(0, 1 - gap_rv)**m",
    "n_l * kd * exp(-sin2_h / n_h**2 / (m*m + 0.01)) + abs(t_l) * m",
    "1 / (n_v - 0.5) * kd + log(m - 1)",
)
CLAIMS = ("reciprocal", "conserving", "isotropic", "physical")
NOT_DRAWN = ("emission", "ambient", "claims")
seeds = st.integers(0, 2**32 - 1)
colors = st.tuples(*[st.floats(0, 1)] * 3)

every_model = pytest.mark.parametrize("Model", MODELS, ids=lambda Model: Model.__name__)


def claiming(claim, value=True):
    chosen = [Model for Model in MODELS if getattr(Model, claim) is value]
    return pytest.mark.parametrize("Model", chosen, ids=lambda Model: Model.__name__)


@pytest.fixture(scope="module", autouse=True)
def measured(tmp_path_factory):
    """Measurements to look up, of noise with gaps."""
    folder = tmp_path_factory.mktemp("measured")
    noise = np.random.default_rng(1).random((3, 90, 90, 180))
    (folder / "noise.binary").write_bytes(merl.encode(np.where(noise < 0.1, np.nan, noise)))
    (folder / "noise.bsdf").write_bytes(rgl_files.tensor_file(rgl_files.noise()))
    for each in FACETS:  # tabulated once, before examples are drawn
        member("illumcli.models", "generated").model_validate({"distribution": each}).prepared(read_numbers)
    MEASURED.update(merl=str(folder / "noise.binary"), rgl=str(folder / "noise.bsdf"))


MEASURED: dict[str, str] = {}
"""A file for each model that reads one."""


def facets(formula):
    """Facets with normals by a formula."""
    return {"p": "formula", "formula": formula}


WIDE = (
    facets("1"),
    facets("exp(-(slope / 0.4)**2) / hn**4"),
    facets("exp(-(x / 0.3)**2 - (y / 0.8)**2) / hn**4"),
    facets("max(0, hb) + 0.2"),
)
FACETS = (
    *WIDE,
    facets("exp(-(slope / 0.001)**2) / hn**4"),
    facets("exp(-((x - 0.5) / 0.05)**2 - ((y + 0.2) / 0.3)**2) / hn**4"),
    {"p": "slopes", "range": [0.2, 3.0], "file": str(Path(__file__).parents[2] / "scenes" / "tiles.png")},
)
"""Distributions of facet normals, narrow ones too; those of the picture are coloured."""


# -- random parameters, from the schema of a model


@functools.cache
def parameters(Model, choices=True, gentle=False):
    """Random values of every parameter; without `choices` only of numbers, the rest at its default.

    `gentle` keeps lobes wide enough for a quadrature.
    """
    schema = schema_of(Model)
    keys = _object(schema, schema.get("$defs", {}), choices, gentle)
    return keys.map(Model.model_validate).map(lambda model: model.prepared(read_numbers))


def _object(schema, defs, choices, gentle):
    tag = schema["properties"].get("model", {}).get("const")
    fields = {
        name: st.builds(lambda: MEASURED[tag])
        if name == "file"
        else st.fixed_dictionaries({"kd": colors, "m": st.floats(0, 20)})
        if name == "parameters"
        else st.sampled_from(WIDE if gentle else FACETS)
        if "p" in field.get("discriminator", {}).values()
        else _field(name, field, defs, choices, gentle)
        for name, field in schema["properties"].items()
        if name not in NOT_DRAWN
    }
    return st.fixed_dictionaries(fields)


def _field(name, field, defs, choices, gentle):
    value = functools.partial(_field, name, defs=defs, choices=choices, gentle=gentle)
    if "$ref" in field:
        return _object(defs[field["$ref"].rpartition("/")[2]], defs, choices, gentle)
    if "const" in field:
        return st.just(field["const"])
    if "anyOf" in field and field["anyOf"][-1]["type"] == "array":  # one number, or a colour
        return value(field["anyOf"][-1])
    if "anyOf" in field:  # something optional
        return st.none() | value(field["anyOf"][0]) if choices else st.just(field["default"])
    if "discriminator" in field:
        refs = list(field["discriminator"]["mapping"].values())
        tag = field["discriminator"]["propertyName"]
        kept = refs if choices else [field["discriminator"]["mapping"][field["default"][tag]]]
        return st.one_of([value({"$ref": ref}) for ref in kept])
    if "oneOf" in field:  # a value, a texture, a vertex attribute
        return value(field["oneOf"][0])
    if "enum" in field:
        return st.sampled_from(field["enum"]) if choices else st.just(field["default"])
    if field["type"] == "string":
        return st.sampled_from(FORMULAS)
    if field["type"] == "boolean":
        return st.booleans() if choices else st.just(field["default"])
    if field["type"] == "array" and "minItems" not in field:  # a list of parts
        part = value(field["items"])
        return st.lists(part, max_size=2).map(tuple) if choices else st.just(field["default"])
    if field["type"] == "array":
        return st.tuples(*[value(field["items"])] * field["minItems"])
    return _number(name, field, gentle)


def _number(name, field, gentle):
    low, high = field.get("minimum", field.get("exclusiveMinimum")), field["maximum"]
    open_low = "exclusiveMinimum" in field
    if gentle:
        low = 0.15 if name in ("m", "alpha", "beta", "alpha_x", "alpha_y", "slope") else low
        high = min(high, 50.0)
    ends = [high] if open_low else [low, high]
    middle = st.floats(low, min(high, 10.0 + low), exclude_min=open_low)
    sharp = st.sampled_from([x for x in (1e-3, 0.999, 1e3, 1e6) if low < x < high] or ends)
    return middle if gentle else st.one_of(middle, sharp, st.sampled_from(ends))


def response(model, given):
    """The sum of all lobes, (N, 3)."""
    return sum(evaluate(model.lobes(), given).values(), np.zeros_like(given["l"]))


# -- promises


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@every_model
@settings(max_examples=60, deadline=None)
@given(data=st.data(), seed=seeds)
def test_lobes_are_finite_not_negative_and_keep_their_precision(Model, dtype, data, seed):
    model = data.draw(parameters(Model))
    given = directions(seed, 64, dtype)
    for name, values in evaluate(model.lobes(), given).items():
        assert values.shape == given["l"].shape, name
        assert values.dtype == dtype, name
        assert np.all(np.isfinite(values)), name
        assert values.min() >= 0, name


@every_model
@settings(max_examples=20, deadline=None)
@given(data=st.data(), seed=seeds)
def test_without_grain_turning_about_the_normal_changes_nothing(Model, data, seed):
    model = data.draw(parameters(Model, gentle=True))
    given = directions(seed, 20)
    turned = {**given, "t": cross(given["n"], given["t"])}
    # where a lobe ends, its base is rounding alone, whose root is large beside it
    if not model.has_grain() and getattr(model, "exponent", 1.0) >= 1:
        np.testing.assert_allclose(response(model, turned), response(model, given), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "grain"),
    [
        ({"model": "ward"}, True),
        ({"model": "ward", "alpha_x": 0.3}, False),
        ({"model": "ward", "alpha_x": {"vertex": "a"}}, True),
        ({"model": "lafortune", "cx": -1.0, "cy": -1.0}, False),
        ({"model": "lafortune", "cx": -1.0, "cy": -0.5}, True),
        ({"model": "ashikhmin_shirley"}, True),
        ({"model": "ashikhmin_shirley", "exponent_v": 100}, False),
        ({"model": "kajiya_kay"}, True),
        ({"model": "cook_torrance"}, False),
        ({"model": "cook_torrance", "distribution": {"D": "ggx", "alpha": 0.2, "alpha_y": 0.2}}, False),
        ({"model": "cook_torrance", "distribution": {"D": "ggx", "alpha": 0.2, "alpha_y": 0.3}}, True),
        ({"model": "cook_torrance", "distribution": {"D": "beckmann", "m_y": 0.1}}, True),
        ({"model": "phong"}, False),
    ],
)
def test_parameters_say_whether_there_is_a_grain(keys, grain):
    assert member("illumcli.models", keys["model"]).model_validate(keys).has_grain() is grain


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"model": "phong"}, lambda n_l: np.ones_like(n_l)),
        ({"model": "phong", "normalised": True}, lambda n_l: n_l / np.pi),
        ({"model": "blinn_phong"}, lambda n_l: np.ones_like(n_l)),
        ({"model": "blinn_phong", "normalised": True}, lambda n_l: n_l / np.pi),
        ({"model": "kajiya_kay"}, lambda n_l: np.ones_like(n_l)),
        ({"model": "lafortune"}, lambda n_l: n_l),
    ],
    ids=lambda value: "-".join(map(str, value.values())) if isinstance(value, dict) else "",
)
def test_an_exponent_of_zero_gives_one_at_any_angle(keys, expected, dtype):
    """0^0 = 1: max(0, cos)^0 is 1 behind the horizon of the lobe too, for all elements or for single ones."""
    given = directions(5, 600, dtype)
    flat = member("illumcli.models", keys["model"]).model_validate(
        {"specular": [1.0, 1.0, 1.0], **keys, "exponent": 0.0}
    )
    want = expected(dot(given["n"], given["l"]))[:, None]
    lanes = np.where(np.arange(len(want)) % 2, 0.0, 50.0).astype(dtype)
    some = flat.at({"exponent": lanes})
    at_all = evaluate({"specular": flat.specular_lobe}, given)["specular"]
    at_some = evaluate({"specular": some.specular_lobe}, given)["specular"]
    np.testing.assert_allclose(at_all, np.broadcast_to(want, at_all.shape), rtol=1e-5)
    np.testing.assert_array_equal(at_some[lanes == 0], at_all[lanes == 0])


@every_model
@settings(max_examples=15, deadline=None)
@given(data=st.data(), seed=seeds)
def test_a_batch_equals_its_rows(Model, data, seed):
    lobes = data.draw(parameters(Model)).lobes()
    given = directions(seed, 37, np.float32)
    batch = evaluate(lobes, given)
    for row in range(len(given["l"])):
        alone = evaluate(
            lobes, {name: x if x.ndim == 1 else column_major(x[row : row + 1]) for name, x in given.items()}
        )
        for name in lobes:
            np.testing.assert_array_equal(alone[name][0], batch[name][row])


@every_model
@settings(max_examples=10, deadline=None)
@given(data=st.data(), seed=seeds)
def test_one_value_per_lane_equals_one_value_for_all(Model, data, seed):
    model = data.draw(parameters(Model))
    given = directions(seed, 20, np.float32)
    count = len(given["l"])
    for path, varying in varied(model, count).items():
        for name, values in evaluate(model.at({path: varying}).lobes(), given).items():
            np.testing.assert_allclose(values, evaluate(model.lobes(), given)[name], rtol=1e-5, err_msg=path)


@every_model
@settings(max_examples=40, deadline=None)
@given(data=st.data(), seed=seeds)
def test_materials_that_are_evaluated_together_have_the_bits_of_each_alone(Model, data, seed):
    drawn = [data.draw(parameters(Model)) for _ in range(3)]
    # others with the same choices, so that some share a batch
    models = [
        *drawn,
        *(each.model_copy(update=numbers(drawn[0], data.draw(parameters(Model)))) for each in drawn[:2]),
    ]
    given = directions(seed, 40, np.float32)
    together = batches(models)
    which = np.random.default_rng(seed).integers(0, len(models), len(given["l"]))
    for number, batch in enumerate(together.every):
        at = np.flatnonzero(together.batch[which] == number)
        here = {name: x if x.ndim == 1 else column_major(x[at]) for name, x in given.items()}
        lobes = batch.at(together.row[which[at]]).lobes()
        values = evaluate(lobes, here)
        for k, material in enumerate(which[at]):
            alone = evaluate(models[material].lobes(), given)
            assert alone.keys() <= values.keys()
            for name, value in values.items():
                # a lobe that is black is left out alone, and 0 among others
                expected = alone[name][at[k]] if name in alone else np.zeros_like(value[k])
                np.testing.assert_array_equal(value[k], expected, err_msg=name)


def numbers(model, other):
    """The numbers and colours of another material, of parameters that both have."""
    return {
        name: value
        for name, value in other
        if may_vary(type(model), name) and value is not None and dict(model)[name] is not None
    }


def varied(part, count, prefix=""):
    """Path -> one value per element, for every parameter that may vary over the surface."""
    found = {}
    for name, value in parts_of(part):
        if isinstance(value, float | tuple) and (isinstance(part, dict) or may_vary(type(part), name)):
            found[prefix + name] = (
                column_major(np.tile(value, (count, 1)))
                if isinstance(value, tuple)
                else np.full(count, value)
            )
        for step, inner in nested(value).items():
            found |= varied(inner, count, f"{prefix}{name}{step}.")
    return found


@pytest.mark.parametrize("Model", WHOLE, ids=lambda Model: Model.__name__)
def test_single_precision_follows_double(Model):
    given = directions(1, 5000, np.float32, least=0.02)
    single = response(Model(), given)
    double = response(Model(), {name: value.astype(np.float64) for name, value in given.items()})
    np.testing.assert_allclose(single, double, rtol=1e-5, atol=1e-6 * double.max())


@claiming("reciprocal")
@settings(max_examples=40, deadline=None)
@given(data=st.data(), seed=seeds)
def test_swapping_light_and_eye_keeps_the_brdf(Model, data, seed):
    model = data.draw(parameters(Model, choices=False))
    given = directions(seed, 64, least=1e-3)
    swapped = given | {"l": given["v"], "v": given["l"]}
    there = response(model, given) / dot(given["n"], given["l"])[:, None]
    back = response(model, swapped) / dot(given["n"], given["v"])[:, None]
    # a lobe is kept precise where it is high: 1 minus its base is summed, and differs in its last bits
    lowest = max(1e-12 * np.abs(there).max(initial=0), 1e-15)
    np.testing.assert_allclose(there, back, rtol=1e-7, atol=lowest)


@claiming("conserving")
@settings(max_examples=15, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.3, 0.05])
def test_no_more_light_leaves_than_arrives(Model, cosine, data):
    model = data.draw(parameters(Model, choices=False, gentle=True))
    for turn in (0.0, 0.8) if not Model.isotropic else (0.0,):
        assert albedo(model, cosine, turn).max() <= 1 + 2e-3


def albedo(model, cosine, turn=0.0):
    """(3,) share reflected towards an eye at this cosine, by reciprocity the share of light from there."""
    node, weight = leggauss(64)
    u, phi = (1 + node) / 2, (np.arange(96) + 0.5) / 96 * 2 * np.pi
    x, p = (grid.ravel() for grid in np.meshgrid(u, phi, indexing="ij"))
    height = x * x  # more nodes at grazing
    level = np.sqrt(1 - height**2)
    count = len(x)
    sine = np.sqrt(1 - cosine**2)
    given = {
        "l": column_major(np.stack([level * np.cos(p), level * np.sin(p), height], 1)),
        "v": column_major(np.tile([sine * np.cos(turn), sine * np.sin(turn), cosine], (count, 1))),
        "n": column_major(np.tile([0.0, 0.0, 1.0], (count, 1))),
        "t": column_major(np.tile([1.0, 0.0, 0.0], (count, 1))),
        "light": np.ones(3),
    }
    area = np.repeat(weight / 2 * 2 * u, 96) * 2 * np.pi / 96
    return area @ response(model, given)


@pytest.mark.parametrize(
    "Model",
    [Model for Model in MODELS if Model.isotropic and "file" not in Model.model_fields],  # tables jump
    ids=lambda Model: Model.__name__,
)
@settings(max_examples=40, deadline=None)
@given(data=st.data(), seed=seeds, angle=st.floats(0, 6.3))
def test_turning_the_surface_changes_nothing(Model, data, seed, angle):
    model = data.draw(parameters(Model, choices=False, gentle=True))
    given = directions(seed, 64, least=1e-3)
    one, other = response(model, given), response(model, turned(given, angle))
    np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9 * one.max(initial=1e-300))


@pytest.mark.parametrize(
    "Model", [Model for Model in WHOLE if not Model.isotropic], ids=lambda Model: Model.__name__
)
def test_turning_the_grain_changes_something(Model):
    grain = {"distribution": WIDE[2]} if Model.__name__ == "Generated" else {"anisotropic": 0.8}
    model = Model() if Model().has_grain() else Model.model_validate(grain)
    assert "t" in given_terms(model.lobes())
    given = directions(5, 64, least=0.1)
    assert not np.allclose(response(model, given), response(model, turned(given, 1.0)), rtol=1e-3)


@every_model
@settings(max_examples=10, deadline=None)
@given(data=st.data(), seed=seeds)
def test_a_skipped_lobe_is_black(Model, data, seed):
    model = data.draw(parameters(Model))
    given = directions(seed, 32)
    for method, names in Model.scales.items():
        for name in names if hasattr(Model, method) else ():
            value = getattr(model, name)
            zero = model.model_copy(update={name: (0.0, 0.0, 0.0) if isinstance(value, tuple) else 0.0})
            lobe = method.removesuffix("_lobe")
            assert lobe not in zero.lobes()
            assert not evaluate({lobe: getattr(zero, method)}, given)[lobe].any()


# -- form


@every_model
def test_the_file_is_named_after_the_tag(Model):
    tag = Model.model_fields["model"].default
    assert Model.__module__ == f"illumcli.models.{tag}"
    assert tag in tags("illumcli.models")


@every_model
def test_the_page_has_formula_and_source(Model):
    text = inspect.getmodule(Model).__doc__
    assert "response = " in text
    assert "References\n----------" in text


@pytest.mark.parametrize(
    "name", ["_base", "_fresnel", "_lafortune", "_distributions", *tags("illumcli.models")]
)
def test_every_parameter_says_what_it_means(name):
    source = Path(inspect.getfile(IlluminationModel)).with_name(f"{name}.py").read_text()
    for cls in (node for node in ast.parse(source).body if isinstance(node, ast.ClassDef)):
        for field, following in zip(cls.body, [*cls.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign) and field.target.id not in (
                *CLAIMS,
                "model",
                "D",
                "F",
                "surface_color",
                "formula",
                "scales",
            ):
                assert isinstance(following, ast.Expr), f"{cls.name}.{field.target.id}"
                assert isinstance(following.value.value, str), f"{cls.name}.{field.target.id}"


@every_model
def test_every_number_has_a_range(Model):
    def numbers(part):
        if isinstance(part, dict):
            if part.get("type") == "number":
                yield part
            for inner in part.values():
                yield from numbers(inner)
        elif isinstance(part, list):
            for inner in part:
                yield from numbers(inner)

    for number in numbers(schema_of(Model)):
        assert "maximum" in number
        assert "minimum" in number or "exclusiveMinimum" in number
