"""Curves: their values at frames, and what they refuse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from illumcli.scene.curves import CURVES
from illumcli.scene.frames import Moment
from illumcli.schema.families import member
from illumcli.schema.sources import tags


def curve(kind, **fields):
    return member(CURVES, kind).model_validate({"curve": kind, **fields})


def value(made, frame, text="", fps=24.0):
    return made.value_at(Moment(frame, frame / fps), lambda path: (Path(path), text))


def test_the_curves():
    assert {"column", "formula", "linear", "sequence", "smooth", "step"} <= set(tags(CURVES))


@pytest.mark.parametrize("kind", ["linear", "smooth"])
def test_a_curve_goes_through_its_keys_and_holds_outside(kind):
    made = curve(kind, keys={"10": 1, "4": 3.5, "20": -2})
    assert [value(made, frame) for frame in (0, 4, 10, 20, 99)] == [3.5, 3.5, 1, -2, -2]
    assert [made.key_at(Moment(frame, 0.0)) for frame in (0, 4, 7, 10, 25)] == ["4", "4", None, "10", "20"]


def test_linear_is_straight_and_colours_are_mixed_in_linear_light():
    assert value(curve("linear", keys={"0": 0, "10": 1}), 3) == 0.3
    mixed = value(curve("linear", keys={"0": "#ffffff", "2": [0, 0, 0.5]}), 1)
    assert mixed == [0.5, 0.5, 0.75]
    assert value(curve("linear", keys={"0": 1, "2": [3, 5, 7]}), 1) == [2, 3, 4]
    assert value(curve("linear", keys={"0": [[1, 2], [3, 4]], "2": [[3, 2], [3, 0]]}), 1) == [[2, 2], [3, 2]]
    turned = curve("linear", keys={"0": [0, 350, 0], "2": [0, 370, 0]})
    assert value(turned, 1) == [0, 360, 0]
    assert value(curve("linear", over="time", keys={"0": 0, "0.5": 12}), 3) == 3


def test_smooth_rests_at_the_ends_and_at_extremes_and_leaves_no_range():
    keys = {"0": 0, "100": 4, "130": 5, "200": 5, "300": 1}
    made = curve("smooth", keys=keys)
    values = np.array([value(made, frame) for frame in range(301)])
    assert value(curve("smooth", keys={"0": 0, "4": 1}), 1) == 0.15625  # 3 t^2 - 2 t^3
    for first, last in ((0, 100), (100, 130), (130, 200), (200, 300)):
        low, high = sorted((values[first], values[last]))
        assert np.all((values[first : last + 1] >= low) & (values[first : last + 1] <= high))
    slope = np.diff(values)
    assert np.abs(slope[[0, 130, 199, 299]]).max() < 0.002  # nearly at rest
    assert np.all(values[130:201] == 5)
    # Fritsch and Butland: weights 2 * 30 + 100 of the slope before, 30 + 2 * 100 of the one after.
    expected = (160 + 230) / (160 / 0.04 + 230 / (1 / 30))
    timed = curve("smooth", over="time", keys=keys)
    near = [timed.value_at(Moment(0, 100 + step), open) for step in (-1e-4, 0, 1e-4)]
    assert np.diff(near) / 1e-4 == pytest.approx(expected, rel=1e-4)


def test_a_step_holds_values_of_any_kind_until_the_next():
    made = curve("step", keys={"0": "clay", "12": {"model": "lambert"}, "20": True})
    assert [made.key_at(Moment(frame, 0.0)) for frame in (0, 11, 12, 19, 20, 50)] == [
        "0", "0", "12", "12", "20", "20"
    ]  # fmt: skip


def test_formulas_know_frame_and_time():
    assert value(curve("formula", value="2*frame + time"), 12) == 24.5
    assert value(curve("formula", value=["cos(pi*time)", 2, "-frame"]), 24) == [-1, 2, -24]
    assert value(curve("formula", value="mod(frame, 10)"), 27) == 7
    with pytest.raises(ValueError, match="'1/frame' is not a finite number"):
        value(curve("formula", value="1/frame"), 0)


def test_a_sequence_has_a_digit_for_every_number_sign():
    assert value(curve("sequence", file="a/bunny.####.obj"), 7) == "a/bunny.0007.obj"
    assert value(curve("sequence", file="#/bunny.#.obj"), 12) == "12/bunny.12.obj"
    assert value(curve("sequence", file="w.##.obj", number="mod(frame, 12)/2 + 1"), 15) == "w.02.obj"
    with pytest.raises(ValueError, match="the number of the file is -1, must be at least 0"):
        value(curve("sequence", file="#.obj", number="frame - 1"), 0)
    with pytest.raises(ValueError, match=r"bunny\.obj has no # for the number"):
        value(curve("sequence", file="bunny.obj"), 0)


TABLE = "frame,x,y,mesh\n0,1,2,a.obj\n\n10,3,-2,b.obj\n"


def test_columns_of_a_table():
    assert value(curve("column", file="t.csv", column="x"), 5, TABLE) == 2
    assert value(curve("column", file="t.csv", column=["x", "y", "x"]), 5, TABLE) == [2, 0, 2]
    assert value(curve("column", file="t.csv", column="mesh", interpolation="step"), 9, TABLE) == "a.obj"
    smooth = curve("column", file="t.csv", column="x", interpolation="smooth")
    assert [value(smooth, frame, TABLE) for frame in (0, 5, 10, 50)] == [1, 2, 3, 3]
    assert value(curve("column", file="t.csv", column="x"), 12, "time,x\n0,0\n1,4\n") == 2
    assert value(curve("column", file="t.csv", column="x"), 1, "x\n5\n6.5\n") == 6.5


@pytest.mark.parametrize(
    ("fields", "text", "said"),
    [
        ({"column": "z"}, TABLE, "t.csv has no column 'z'; there are: frame, x, y, mesh"),
        ({"column": "mesh"}, TABLE, "must be numbers, is text 'a.obj'"),
        ({"column": "x"}, "x\n", "t.csv has no rows"),
        ({"column": "x"}, "x,y\n1\n", "row 2 has 1 cells, the first line 2"),
        ({"column": "x"}, "frame,x\n1,1\n1,2\n", "two rows with the same frame"),
        ({"column": "x"}, "frame,x\n1,1\n1.0,2\n", "the keys 1 and 1.0 are the same"),
        ({"column": "x"}, "frame,x\na,1\n", "the key 'a' is no number"),
        ({"column": "x"}, "x\nnan\n", "must be numbers, is text 'nan'"),
        ({"column": "x"}, "x\n1\n2\n", "t.csv has 2 rows, for frames 0 to 1; add rows, or a column frame"),
    ],
)
def test_what_a_table_lacks_is_told(fields, text, said):
    with pytest.raises(ValueError, match=said):
        value(curve("column", file="t.csv", **fields), 2, text)


@pytest.mark.parametrize(
    ("kind", "fields", "said"),
    [
        ("linear", {"keys": {}}, "at least 1"),
        ("linear", {"keys": {"a": 1}}, "the key 'a' is no number; write keys as {0: VALUE, 24: VALUE}"),
        ("linear", {"keys": {"nan": 1}}, "the key 'nan' is no number"),
        ("linear", {"keys": {"1": 1, "1.0": 2}}, "the keys 1 and 1.0 are the same; remove one"),
        ("linear", {"keys": {"0": [1, 2], "1": [1, 2, 3]}}, "have 2 and 3 numbers; give all keys as many"),
        (
            "smooth",
            {"keys": {"0": "clay"}},
            "must be numbers, is text 'clay'; what is no number has curve: step",
        ),
        ("smooth", {"keys": {"0": True}}, "must be numbers, is true"),
        ("linear", {"keys": {"0": "#12"}}, "must be one number"),
        ("formula", {"value": "frame +"}, "position"),
        ("formula", {"value": "x"}, "unknown name 'x'; there are: frame, time, pi, e"),
        ("formula", {"value": "__import__('os')"}, "position"),
        ("sequence", {"file": "#.obj", "number": "n"}, "unknown name 'n'"),
    ],
)
def test_what_is_no_curve_is_refused(kind, fields, said):
    with pytest.raises(ValidationError) as caught:
        curve(kind, **fields)
    assert said in str(caught.value)
