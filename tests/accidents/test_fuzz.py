"""Scenes with changed bytes, and scenes drawn from the schema: loaded or refused, nothing else."""

from __future__ import annotations

import importlib.util
import random
import sys

import pytest


@pytest.fixture
def fuzz(root):
    spec = importlib.util.spec_from_file_location("fuzz_script", root / "benchmarks" / "fuzz.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


COUNTS = [150, pytest.param(20_000, marks=pytest.mark.slow)]


@pytest.mark.parametrize("count", COUNTS)
def test_changed_scene_files_are_loaded_or_refused(fuzz, count, capsys):
    found = fuzz.tried(fuzz.scene_cases(count, random.Random(count)), ".yaml", fuzz.load_and_plan)
    assert {what for what in found if what != "slow"} <= {"loaded", "refused, exit 2", "refused, exit 4"}, (
        found
    )
    assert found["loaded"]


@pytest.mark.parametrize("count", COUNTS)
def test_scenes_of_the_schema_are_loaded_or_refused(fuzz, count):
    cases = [text.encode() for text in fuzz.schema_cases(count, count)]
    found = fuzz.tried(cases, ".yaml", fuzz.load_and_plan)
    assert {what for what in found if what != "slow"} <= {"loaded", "refused, exit 2", "refused, exit 4"}, (
        found
    )
