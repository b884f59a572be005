"""Random scenes, each rendered in two ways that must agree: `of_*` say which."""

from __future__ import annotations

import shutil
from collections import Counter
from contextlib import suppress
from random import Random

import pytest

from illumcli.scene.spec import Scene
from illumcli.schema.sources import tags
from metamorphic import of_bakes, of_light, of_meshes, of_motions, of_objects, of_runs, of_visibility
from metamorphic.pictures import Studio
from metamorphic.relation import Relation
from metamorphic.scenes import Case, drawn, reduced
from metamorphic.surfaces import WRITERS

MODULES = (of_light, of_objects, of_meshes, of_visibility, of_bakes, of_motions, of_runs)
RELATIONS = [each for module in MODULES for each in vars(module).values() if isinstance(each, Relation)]
CASES = 3
"""Of each relation."""
SLOW, AT_ONCE = 150, 25
"""The same in the slow run, and how many of them are one test."""


def seeds():
    for relation in RELATIONS:
        yield pytest.param(relation, range(CASES), id=relation.name)
        for first in range(CASES, SLOW, AT_ONCE):
            some = range(first, min(first + AT_ONCE, SLOW))
            yield pytest.param(relation, some, id=f"{relation.name}-{first}", marks=pytest.mark.slow)


@pytest.mark.parametrize(("relation", "seeds"), list(seeds()))
def test_both_ways_agree(relation, seeds, tmp_path):
    studio = Studio(tmp_path)
    for seed in seeds:

        def fault(case: Case, seed: int = seed) -> str | None:
            """Why the relation does not hold for a case; None where it holds."""
            try:
                relation.check(case, Random(seed), studio)
            except AssertionError as error:
                return str(error)
            return None

        if told := fault(drawn(seed)):
            case = smallest(drawn(seed), fault)
            shutil.rmtree(tmp_path)
            with suppress(AssertionError):
                relation.check(case, Random(seed), Studio(tmp_path))
            pytest.fail(f"{relation.name}, seed {seed}: {told}\nFails too, see {tmp_path}:\n{case.text()}")
    shutil.rmtree(tmp_path)


def smallest(case, fault):
    """A smaller case with a fault."""

    def fails(case: Case) -> bool:
        try:
            return fault(case) is not None
        except Exception:  # what is left is no scene any more, or not one of the relation's
            return False

    return reduced(case, fails)


def test_every_feature_is_drawn():
    """What there is of each family occurs in the scenes of the slow run, and most of it often."""
    found: Counter[str] = Counter()

    def count(part, key=""):
        if isinstance(part, dict):
            found.update(list(part))
            for step, value in part.items():
                count(value, step)
        elif isinstance(part, list):
            for value in part:
                count(value)
        elif isinstance(part, str):
            found[f"{key} {part}"] += 1

    for seed in range(SLOW):
        case = drawn(seed)
        count(case.scene)
        found.update(f"file {name.partition('.')[2]}" for name in case.meshes)
    families = {
        "model": "models",
        "shape": "geometry.shapes",
        "light": "lights",
        "falloff": "visibility.falloffs",
    }
    wanted = {f"{key} {tag}" for key, package in families.items() for tag in tags(f"illumcli.{package}")}
    wanted |= {f"file {suffix}" for suffix in WRITERS}
    wanted |= set(Scene.model_fields) - {"camera", "outputs", "frames"}  # frames have a relation of their own
    assert {name for name in wanted if found[name] < 2} == set()
