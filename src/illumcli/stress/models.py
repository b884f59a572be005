"""Every illumination model with parameters at the ends of their ranges, for all kinds of directions."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import column_major, cross, dot, unit
from illumcli.commands.schema_generator import schema_of
from illumcli.schema.families import members, tag_of
from illumcli.shading.terms import evaluate
from illumcli.stress.sandbox import CheckResult


def check_models(quick: bool) -> list[CheckResult]:
    """A result per model; those that need something, such as a measurement or a formula, are left out."""
    points, draws = (256, 20) if quick else (4096, 400)
    models = [
        Model
        for Model in members("illumcli.models")
        if not any(field.is_required() for field in Model.model_fields.values())
    ]
    return [_result(Model, points, draws) for Model in models]


def _result(Model: type[Any], points: int, draws: int) -> CheckResult:
    """The check of one model with `draws` random sets of parameters, at `points` points each."""
    random = np.random.default_rng(1)
    wrong: list[str] = []
    values = sets = 0
    for description in parameters(Model, random, draws):
        model = Model.model_validate(description)
        sets += 1
        for dtype in (np.float32, np.float64):
            given = directions(sets, points, dtype)
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                try:
                    lobes = evaluate(model.lobes(), given)
                except (ArithmeticError, RuntimeWarning) as error:
                    wrong.append(f"{description}: {error}")
                    continue
            for name, lobe in lobes.items():
                values += lobe.size
                if lobe.dtype != dtype or not np.isfinite(lobe).all() or lobe.min() < 0:
                    bad = np.count_nonzero(~np.isfinite(lobe) | (lobe < 0))
                    wrong.append(f"{description}: {name} wrong in {bad} values of {dtype.__name__}")
    check = f"{sets} sets of parameters, {values:,} values: finite, not negative"
    return CheckResult(f"model: {tag_of(Model)}", check, wrong[0] if wrong else "-", not wrong)


def parameters(Model: type[Any], random: np.random.Generator, draws: int) -> Iterator[dict[str, Any]]:
    """Sets of parameters: each field at its ends with the others at their defaults, then all fields drawn at
    random from ends, values between and choices."""
    # The fields from the JSON schema.
    schema = schema_of(Model)
    defs = schema.get("$defs", {})
    tag = {"model": tag_of(Model)}
    fields = {
        name: field
        for name, field in schema["properties"].items()
        if name not in ("model", "emission", "ambient")
    }

    yield tag
    for name, field in fields.items():
        for value in _ends(field, defs):
            yield {**tag, name: value}
    for _ in range(draws):
        yield {**tag, **{name: _drawn(field, defs, random) for name, field in fields.items()}}


def _ends(field: dict[str, Any], defs: dict[str, Any]) -> list[Any]:
    """The values at the ends of a field's range, or all choices."""
    # A nested description, or alternatives.
    if "$ref" in field:
        inner = defs[field["$ref"].rpartition("/")[2]]
        if "properties" not in inner:
            return _ends(inner, defs)
        if "file" in inner.get("required", ()):
            return []
        fixed = {n: f["const"] for n, f in inner["properties"].items() if "const" in f}
        free = {n: f for n, f in inner["properties"].items() if "const" not in f}
        return [fixed] + [{**fixed, n: end} for n, f in free.items() for end in _ends(f, defs)]
    for several in ("anyOf", "oneOf"):
        if several in field:
            chosen = field[several] if "discriminator" in field else field[several][:1]
            return [end for choice in chosen for end in _ends(choice, defs)]

    # Choices.
    if "const" in field:
        return [field["const"]]
    if "enum" in field:
        return list(field["enum"])
    if field.get("type") == "string":
        return [field["default"]]
    if field.get("type") == "boolean":
        return [False, True]

    # Colours and numbers.
    if field.get("type") == "array":
        ends = _ends(field["items"], defs)
        return [[end] * 3 for end in ends] + [[ends[0], ends[-1], ends[0]]]
    low = field.get("minimum", field.get("exclusiveMinimum", 0.0))
    least = np.nextafter(low, np.inf) if "exclusiveMinimum" in field else low
    high = field["maximum"]
    return [float(least), float(high)]


def _drawn(field: dict[str, Any], defs: dict[str, Any], random: np.random.Generator) -> Any:
    ends = _ends(field, defs)
    value = ends[random.integers(len(ends))]
    if isinstance(value, float) and random.random() < 0.5:
        low, high = min(ends), min(max(ends), 1e3)
        return float(
            random.uniform(low, high) if random.random() < 0.5 else max(low, high * random.random() ** 8)
        )
    return value


def directions(seed: int, count: int, dtype: Any) -> dict[str, NDArray[Any]]:
    """Unit n, t, l, v with n.l > 0: v is general, grazing to 1e-7, mirrored, along l, or below."""
    # Frames.
    random = np.random.default_rng(seed)
    n = unit(column_major(random.normal(size=(count, 3))))
    t = unit(cross(n, unit(column_major(random.normal(size=(count, 3))))))
    b = cross(n, t)

    def above() -> NDArray[np.float64]:
        height = 10.0 ** random.choice([-7, -4, -2, 0, 0], count) * random.random(count)
        turn, level = random.random(count) * 2 * np.pi, np.sqrt(1 - height * height)
        return column_major(
            height[:, None] * n + (level * np.cos(turn))[:, None] * t + (level * np.sin(turn))[:, None] * b
        )

    # Light and eye above the horizon, then special cases of the eye.
    l, v = above(), above()
    kind = random.integers(0, 8, count)
    mirrored = 2 * dot(n, l)[:, None] * n - l
    for number, other in enumerate((mirrored, l, -l, n, t, v - 2 * dot(n, v)[:, None] * n)):
        v[kind == number] = other[kind == number]

    # In the requested precision, where the light is above the horizon.
    v = column_major(unit(v), np.float64)
    given = {name: column_major(x.astype(dtype)) for name, x in {"n": n, "t": t, "l": l, "v": v}.items()}
    lit = dot(given["n"], given["l"]) > 0
    return {name: column_major(x[lit]) for name, x in given.items()} | {
        "light": np.array([1, 0.5, 0.25], dtype)
    }
