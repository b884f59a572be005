"""Defaults of a scene, and agreement between its schema and what is accepted."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from illumcli.commands.schema_generator import schema_of
from illumcli.layers import NAMES
from illumcli.scene.access import PATHS
from illumcli.scene.references import reference_faults
from illumcli.scene.spec import Scene
from illumcli.schema.docs import field_docs

SCHEMA = schema_of(Scene)


def scene(**parts: Any) -> Scene:
    return Scene.model_validate({"version": 1, **parts})


def test_a_scene_of_one_mesh():
    made = scene(objects=[{"mesh": "bunny.obj"}])
    assert list(made.named_cameras()) == ["main"]
    assert made.object_names() == ("object1",)
    assert (made.film.width, made.film.height, made.film.samples) == (1280, 720, 4)
    assert made.obscurance is None
    assert made.outputs.layers == ("beauty",)


@pytest.mark.parametrize(
    ("ambient", "color", "form"),
    [
        (0.2, (0.2, 0.2, 0.2), "separate"),
        ([0.1, 0.2, 0.3], (0.1, 0.2, 0.3), "separate"),
        ("coupled", (1, 1, 1), "coupled"),
        ({"color": 1, "form": "coupled"}, (1, 1, 1), "coupled"),
    ],
)
def test_ambient_may_be_written_short(ambient, color, form):
    made = scene(ambient=ambient).ambient
    assert (made.color, made.form) == (color, form)


@pytest.mark.parametrize(
    ("adaptive", "probes", "difference"),
    [(True, None, 0.02), ({}, None, 0.02), (5, 5, 0.02), ({"first": 3, "difference": 0.1}, 3, 0.1)],
)
def test_adaptive_may_be_written_short_and_as_in_0_1_0(adaptive, probes, difference):
    made = scene(film={"samples": 16, "adaptive": adaptive}).film.adaptive
    assert (made.probes, made.difference) == (probes, difference)


def test_an_override_changes_only_what_it_says():
    made = scene(
        materials={"clay": {"model": "phong", "diffuse": 0.5, "exponent": 7}},
        objects=[
            {"mesh": "a.obj", "material": "clay", "override": {"exponent": 9}},
            {"mesh": "a.obj", "override": {"diffuse": 0.1}},
            {"mesh": "a.obj"},
        ],
    )
    first, second, third = (made.material_of(each) for each in made.objects)
    assert (first.exponent, first.diffuse) == (9, (0.5, 0.5, 0.5))
    assert second.diffuse == (0.1, 0.1, 0.1)
    assert third is None


def test_scenes_made_without_a_file_are_checked_too():
    with pytest.raises(ValidationError, match="no material 'caly'; did you mean 'clay'"):
        scene(materials={"clay": {"model": "phong"}}, objects=[{"mesh": "a.obj", "material": "caly"}])


@pytest.mark.parametrize(
    "tree",
    [
        None,
        3,
        [],
        {"objects": 3},
        {"objects": [1, None, {"mesh": [], "override": {"a": 1}, "material": {"model": []}}]},
    ],
)
def test_references_pass_over_what_they_do_not_understand(tree):
    assert list(reference_faults(tree)) == []


def test_layers_of_the_schema_are_the_layers():
    layers = SCHEMA["$defs"]["Outputs"]["properties"]["layers"]
    assert tuple(layers["items"]["enum"]) == NAMES
    assert [name for name in NAMES if f"`{name}`: " not in layers["description"]] == []


def test_every_path_of_the_schema_is_known_as_one():
    """Paths are found by key: those written in an extended scene begin in its own folder."""
    found = {
        name
        for part in walk(SCHEMA)
        for name, each in part.get("properties", {}).items()
        if each.get("description", "").startswith("Path")
    }
    assert found
    assert found <= set(PATHS)


def walk(part: Any) -> list[dict[str, Any]]:
    """Every mapping in a schema."""
    if isinstance(part, dict):
        return [part, *(each for value in part.values() for each in walk(value))]
    return [each for value in part for each in walk(value)] if isinstance(part, list) else []


def test_a_description_notes_the_fields_of_its_bases():
    from illumcli.lights.point import Point

    docs = field_docs(Point)
    assert docs["position"] == "Where it is [scene units]."
    assert docs["shadows"].startswith("False: the light passes through everything")


# scenes generated from the schema


REAL = st.floats(allow_nan=False, allow_infinity=False)
WORDS = st.sampled_from(["key", "fill", "a_b", "x-1", "Name"])
FREE = {
    "f": "x*x + y*y + z*z - 1",
    "x": "cos(u)",
    "y": "sin(v)",
    "z": "u*v",
    "formulas": "2*frame",
}  # texts that must be formulas


def values(part: dict[str, Any], name: str = "") -> st.SearchStrategy[Any]:
    """Values that a schema accepts."""
    if "$ref" in part:
        return st.deferred(lambda: values(SCHEMA["$defs"][part["$ref"].rpartition("/")[2]], name))
    if "const" in part:
        return st.just(part["const"])
    if "enum" in part:
        return st.sampled_from(part["enum"])
    for choice in ("oneOf", "anyOf"):
        if choice in part:
            return st.one_of([values(each, name) for each in part[choice]])
    match part.get("type"):
        case "null":
            return st.none()
        case "boolean":
            return st.booleans()
        case "integer":
            return st.integers(part.get("minimum", 0), min(part.get("maximum", 9), 10**6))
        case "number":
            low, high = part.get("minimum", part.get("exclusiveMinimum", -1e18)), part.get("maximum", 1e18)
            top = part.get("exclusiveMaximum", high)
            open_ends = {"exclude_min": "exclusiveMinimum" in part, "exclude_max": "exclusiveMaximum" in part}
            return st.floats(low, min(high, top), allow_subnormal=False, **open_ends)
        case "string":
            pattern = part.get("pattern", "")
            if pattern.startswith("^#"):
                return st.from_regex(pattern, fullmatch=True)
            return (
                st.just("0.5r") if pattern.endswith("r$") else st.just(FREE[name]) if name in FREE else WORDS
            )
        case "array" if "prefixItems" in part:
            return st.tuples(*(values(each) for each in part["prefixItems"])).map(list)
        case "array":
            least = part.get("minItems", 0)
            return st.lists(values(part["items"], name), min_size=least, max_size=max(least, 2))
        case "object" if "patternProperties" in part:
            (inner,) = part["patternProperties"].values()
            return st.dictionaries(WORDS, values(inner), max_size=2)
        case "object" if "properties" in part:
            parts = {key: values(each, key) for key, each in part["properties"].items()}
            required = part.get("required", ())
            return st.fixed_dictionaries(
                {key: each for key, each in parts.items() if key in required},
                optional={key: each for key, each in parts.items() if key not in required},
            )
        case _:
            return st.just({})


RELATIONS = {"value_error", "name"}  # what no schema says: rules between fields, and names


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_scenes_from_the_schema_are_accepted_and_survive_a_round_trip(data):
    parts = {name: values(part, name) for name, part in SCHEMA["properties"].items()}
    name = data.draw(st.sampled_from(sorted(parts)))
    tree = {"version": 1, name: data.draw(parts[name])}
    try:
        made = Scene.model_validate(tree)
    except ValidationError as error:
        kinds = {each["type"] for each in error.errors(include_url=False)}
        assume(not kinds <= RELATIONS)
        raise
    assert Scene.model_validate(json.loads(json.dumps(made, default=dict))) == made


def test_planning_a_scene_loads_no_ray_tracer_and_no_image_library():
    code = (
        "import sys, illumcli.scene.load; print([m for m in ('embreex', 'OpenImageIO') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_materials_in_place_take_overrides_too():
    made = scene(
        objects=[
            {"mesh": "a.obj", "material": {"model": "phong", "exponent": 7}, "override": {"diffuse": 0.2}}
        ]
    )
    found = made.material_of(made.objects[0])
    assert (found.exponent, found.diffuse) == (7, (0.2, 0.2, 0.2))


@pytest.mark.parametrize("far", [1, 2])
def test_depth_cueing_needs_some_depth(far):
    with pytest.raises(ValidationError, match=f"near must be below far, is 2 with far {far}"):
        scene(depth_cue={"near": 2, "far": far})
    assert scene(depth_cue={"near": 2, "far": 2.5}).depth_cue.far == 2.5
