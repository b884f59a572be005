"""Published values, and functions that evaluate models on them."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from illumcli.arrays import column_major, dot, unit
from illumcli.shading.terms import TERMS, evaluate, ordered_terms
from illumcli.verification.vectors import OPENERS, PACKAGED

Case = dict[str, Any]


def unit_vectors(inputs: dict[str, Any]) -> dict[str, np.ndarray]:
    """(1, 3) unit vectors of a case in float64; the tangent at right angles to the normal."""
    words = {
        word: unit(column_major([inputs[word]], np.float64))
        for word in ("n", "l", "v", "t", "h")
        if word in inputs
    }
    if {"n", "t"} <= words.keys():
        n, t = words["n"], words["t"]
        words["t"] = unit(t - dot(n, t)[:, None] * n)
    return words


@pytest.fixture(scope="session")
def frame() -> Callable[[dict[str, Any]], dict[str, np.ndarray]]:
    """A case's vectors: (1, 3), unit, float64."""
    return unit_vectors


@pytest.fixture(scope="session")
def cases() -> Callable[[str], list[Case]]:
    """Model name -> its cases in the vectors of the package, without those with `parameters`: `illum verify`
    needs no evaluator for them."""
    by_model: dict[str, list[Case]] = defaultdict(list)
    for file in PACKAGED.iterdir():
        with OPENERS.get(file.suffix, open)(file) as text:
            for case in json.load(text):
                if "parameters" in case["inputs"]:
                    continue
                by_model[case["model"]].append(case)
    return lambda name: by_model[name]


@pytest.fixture(scope="session")
def term() -> Callable[..., Any]:
    """A term's value on given vectors: term("n_h", n=..., l=..., v=...)."""

    def value(name: str, **given: np.ndarray) -> np.ndarray:
        buffers = dict(given)
        for node in ordered_terms((name,), tuple(given)):
            buffers[node.output] = node.run(buffers)
        assert name in TERMS
        return buffers[name]

    return value


@pytest.fixture(scope="session")
def respond() -> Callable[..., np.ndarray]:
    """The sum of a model's lobes on a case's vectors, (3,) float64; 0 where light or eye is below."""

    def response(model: Any, inputs: dict[str, Any]) -> np.ndarray:
        given = unit_vectors(inputs)
        if "n" in given and min(dot(given["n"], given["l"]), dot(given["n"], given["v"])) <= 0:
            return np.zeros(3)
        return sum((lobe[0] for lobe in evaluate(model.lobes(), given).values()), np.zeros(3))

    return response


@pytest.fixture(scope="session")
def brdf(respond: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """The response over n.l, (3,) float64."""

    def value(model: Any, inputs: dict[str, Any]) -> np.ndarray:
        given = unit_vectors(inputs)
        return respond(model, inputs) / dot(given["n"], given["l"])

    return value


@pytest.fixture(scope="session")
def agree() -> Callable[[Any, Case], None]:
    """Assert that a result is as close to the case's expected value as the case asks for."""

    def check(result: Any, case: Case) -> None:
        expected = np.atleast_1d(np.asarray(case["expected"], np.float64))
        error = np.abs(np.asarray(result, np.float64) - expected).max()
        limit = case["atol"] + case["rtol"] * np.abs(expected).max()
        assert error <= limit, (
            f"{case['id']} ({case['note']}): {result} against {expected}, off by {error / limit:.3g} limits"
        )

    return check


@pytest.fixture
def agree_under_lights(cases, respond, agree) -> Callable[..., None]:
    """Compares a model with published sums over several lights, of colours or of one channel."""

    def check(name: str, Model: type[Any], lobe: str | None = None) -> None:
        for case in cases(name):
            i = case["inputs"]
            if lobe is not None and i["lobe"] != lobe:
                continue
            diffuse = tuple(np.broadcast_to(i["kd"], 3).tolist())
            model = Model(diffuse=diffuse, specular=(i["ks"],) * 3, exponent=float(i["exponent"]))
            direct = sum(
                respond(model, i | light) * np.array(light["intensity"]) * light["f_d"]
                for light in i["lights"]
            )
            total = np.array(i["Ie"]) + np.array(i["Ia"]) * i["ka"] + direct
            agree(total if np.ndim(i["kd"]) else total[0], case)

    return check
