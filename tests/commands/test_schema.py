"""The scene's JSON schema: it accepts scenes, refuses anything else, and explains every key."""

from __future__ import annotations

from typing import Any

import pytest
from jsonschema import Draft202012Validator

from illumcli.commands.schema import schema
from illumcli.scene.source import read
from illumcli.schema.docs import choices

SCHEMA = schema()
VALIDATOR = Draft202012Validator(SCHEMA)


def faults(text: str) -> list[str]:
    tree, problems = read(text.encode(), "s.yaml")
    assert tree is not None
    assert not problems
    return [fault.message for fault in VALIDATOR.iter_errors(tree.plain())]


def test_it_is_a_schema():
    Draft202012Validator.check_schema(SCHEMA)


def test_shipped_scenes_are_accepted(root):
    paths = [*sorted((root / "scenes").glob("*.yaml")), root / "src" / "illumcli" / "scene" / "studio.yaml"]
    assert len(paths) > 10
    for path in paths:
        assert faults(path.read_text()) == [], path.name


@pytest.mark.parametrize(
    "text",
    [
        "materials: {a: {exponent: 3}, b: null}\nobscurance: {falloff: {max_distance: 3}}",
        "film: null\nlights: null\nambient: 0.3",
        "camera: {fov: 30}\ncameras: {side: {extent: 3}}",
        "meshes: {a: {radius: 3}, b: {normals: {crease: null}}}",
        "materials: {a: {diffuse: {wrap: clamp}, distribution: {m: 0.1}, fresnel: {F: schlick}}}",
    ],
)
def test_a_scene_that_extends_another_need_not_be_whole(text):
    assert faults(f"extends: base.yaml\n{text}") == []
    assert faults(f"extends: [a.yaml, b.yaml]\n{text}") == []


@pytest.mark.parametrize(
    "text",
    [
        "ambient: {curve: linear, keys: {0: 0, 24: [1, 0, 1]}}",
        "ambient: {form: coupled, color: {curve: smooth, over: time, keys: {0.5: '#fff', 1: 0}}}",
        "seed: {curve: formula, value: frame}",
        "camera: {position: [{curve: formula, value: 'cos(time)'}, 2, 3], fov: {curve: step, keys: {0: 30}}}",
        "camera: {curve: step, keys: {0: {fov: 30}}}",
        "lights: [{light: point, position: {curve: column, file: a.csv, column: [x, y, z]}}]",
        "objects: [{mesh: {file: {curve: sequence, file: a.#.obj, number: 'mod(frame, 3)'}}}]",
        "materials: {a: {model: phong, diffuse: {texture: {curve: step, keys: {0: a.png}}}}}",
        "outputs: {layers: [{curve: step, keys: {0: depth}}]}",
    ],
)
def test_any_value_may_be_a_curve(text):
    assert faults(f"version: 1\nframes: {{last: 9}}\n{text}") == []
    assert faults(f"extends: a.yaml\n{text}") == []


@pytest.mark.parametrize(
    "text",
    [
        "version: {curve: step, keys: {0: 1}}",
        "version: 1\nframes: {last: {curve: step, keys: {0: 1}}}",
        "version: 1\nframes: {first: 3}",
        "version: 1\nseed: {curve: formla, value: frame}",
        "version: 1\nseed: {curve: step, keys: {a: 1}}",
        "version: 1\nseed: {curve: linear}",
        "version: 1\nlights: [{light: {curve: step, keys: {0: point}}, position: [0, 0, 0]}]",
    ],
)
def test_what_is_no_curve_is_refused(text):
    assert faults(text)


@pytest.mark.parametrize(
    "text",
    [
        "seed: 1",
        "version: 1\nlights: [{light: point}]",
        "version: 1\nmaterials: {a: {exponent: 3}}",
        "version: 1\nobjects: [{}]",
        "version: 1\nfilm: null",
        "extends: a.yaml\nmaterials: {a: {exponnt: 3}}",
        "extends: a.yaml\nfilm: {samples: 0}",
        "extends: a.yaml\nlights: [{light: point}]",
        "extends: 3",
    ],
)
def test_what_is_no_scene_is_refused(text):
    assert faults(text)


def parts(schema: Any, path: str = "") -> Any:
    """Every property with its path, `definition.key`, those of alternatives included."""
    if isinstance(schema, dict):
        for name, part in schema.get("properties", {}).items():
            yield f"{path}.{name}", part
        for key, part in schema.items():
            yield from parts(
                part, path if key in ("anyOf", "oneOf", "items", "properties") else f"{path}/{key}"
            )
    elif isinstance(schema, list):
        for part in schema:
            yield from parts(part, path)


def test_every_property_and_tag_is_described():
    found = list(parts(SCHEMA))
    assert len(found) > 300
    assert [path for path, part in found if len(part.get("description", "")) < 9] == []


def enums(part: Any) -> Any:
    """Every choice within a property, not behind references."""
    if isinstance(part, dict):
        if "enum" in part:
            yield part
        for key in ("anyOf", "oneOf", "items"):
            inner = part.get(key, [])
            yield from enums(inner)
    elif isinstance(part, list):
        for each in part:
            yield from enums(each)


def test_every_choice_has_a_sentence():
    count = 0
    for path, part in parts(SCHEMA):
        for inner in enums(part):
            count += 1
            said = inner.get("enumDescriptions", ())
            assert len(said) == len(inner["enum"]), path
            assert all(len(sentence) >= 4 and sentence.endswith(".") for sentence in said), (path, said)
    assert count > 20


def test_choices_are_read_from_a_text():
    text = "How. `a`: this one; as `b` is not. `b`: the other."
    assert choices(text, ("b", "a")) == ["the other.", "this one; as `b` is not."]
    assert choices(text, ("a", "c")) == []
