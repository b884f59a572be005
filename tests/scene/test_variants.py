"""The variants that `-D`, `--rows` and `--frames` describe."""

from __future__ import annotations

import re

import pytest

from illumcli.errors import InputError, LimitError
from illumcli.scene.variants import at_frame, axis_of, split_at_commas, variants_of


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a=1,2,3", ["1", "2", "3"]),
        ("a=0:1:5", ["0", "0.25", "0.5", "0.75", "1"]),
        ("a=1:100:3log", ["1", "10", "100"]),
        ("a=0.1:0.3:3", ["0.1", "0.2", "0.3"]),
        ("a=5:5:1", ["5"]),
        ("a=[1,2,3],[4,5,6]", ["[1,2,3]", "[4,5,6]"]),
        ("a={law: none, c: [1,2]},null", ["{law: none, c: [1,2]}", "null"]),
        ("a='x,y',z", ["'x,y'", "z"]),
    ],
)
def test_values_of_an_axis(text, values):
    assert list(axis_of(text).values) == values


NINES = "9" * 20


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"frames": f"0:{NINES}"}, "frames are counted up to"),
        ({"frames": f"{NINES}:{NINES}"}, "frames are counted up to"),
        ({"frames": f"0:{'9' * 5000}"}, "frames are counted up to"),
        ({"frames": f"0:1:{NINES}"}, "frames are counted up to"),
        ({"frames": "0:9007199254740993"}, "frames are counted up to"),
        ({"frames": "0:9007199254740992"}, "9007199254740993 variants are more than 100000"),
        ({"texts": [f"a=0:1:{'9' * 5000}"]}, "the count must be from 1 to 100000"),
        ({"texts": ["a=0:1e999:3"]}, "both ends must be finite numbers"),
        ({"texts": [f"{name}=0:1:90000" for name in "abcdef"]}, "variants are more than 100000"),
        ({"texts": ["a=" + "[" * 9000 + "frame" + "]" * 9000], "frames": "0:1"}, "nested deeper than 32"),
    ],
)
def test_more_than_any_sweep_has_is_refused_in_a_short_line(words, said):
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        variants_of(**{"texts": [], **words})
    assert len(str(caught.value)) < 200


def test_tables_of_variants_have_limits(tmp_path, monkeypatch):
    table = tmp_path / "rows.csv"
    table.write_text("a\n" + "1" * 200_000 + "\n")
    with pytest.raises(InputError, match=r"rows\.csv: cannot be read: field larger"):
        variants_of([], rows=table)
    monkeypatch.setattr("illumcli.scene.variants.MAX_TABLE_BYTES", 10)
    with pytest.raises(LimitError, match="larger than 10 bytes"):
        variants_of([], rows=table)


def test_all_variants_have_the_same_frames(tmp_path):
    (tmp_path / "rows.csv").write_text("frames.last\n3\n")
    for words in ({"texts": ["frames.last=1,2"]}, {"texts": [], "rows": tmp_path / "rows.csv"}):
        with pytest.raises(InputError, match="all variants have the same frames; give it one value with -D"):
            variants_of(**words)
    assert len(variants_of(["frames.last=2"])) == 1


@pytest.mark.parametrize("text", ["a", "=1", "a=1,,2", "a=0:1:3log", "a=0:1:0", "a=-1:1:4log"])
def test_an_axis_that_says_nothing_is_refused(text):
    with pytest.raises(InputError):
        axis_of(text)


@pytest.mark.parametrize(
    ("text", "values", "names"),
    [
        ("a=rough:0.5,0.1", ["0.5", "0.1"], ["rough", "0.1"]),
        ("a=red:[1,0,0],blue:[0,0,1]", ["[1,0,0]", "[0,0,1]"], ["red", "blue"]),
        ("a=law: none,C:/a.obj,http://a", ["law: none", "C:/a.obj", "http://a"], None),
        ("a=0:1:2", ["0", "1"], None),
    ],
)
def test_a_value_may_have_a_name(text, values, names):
    axis = axis_of(text)
    assert list(axis.values) == values
    assert list(axis.names) == (names or values)


def test_labels_hold_what_differs(tmp_path):
    rows = tmp_path / "rows.csv"
    rows.write_text("label,m.a,m.b\nmatte,1,2\nshiny,3,2\n")
    variants = variants_of(["s.c=small:4,8", "s.d=9"], rows=rows)
    assert [variant.label for variant in variants] == [
        "matte, small", "matte, c 8", "shiny, small", "shiny, c 8"
    ]  # fmt: skip
    assert variants[0].values == {"m.a": "1", "m.b": "2", "s.c": "4", "s.d": "9"}
    assert variants[0].fields == {"label": "matte", "s.c": "small"}
    spread = variants_of(["s.c=1:100:4log", "s.d=0.12345678,0.12345679"])
    assert [variant.label for variant in spread[:3]] == [
        "c 1, d 0.12345678", "c 1, d 0.12345679", "c 4.642, d 0.12345678"
    ]  # fmt: skip
    assert spread[2].values["s.c"] == "4.64158883361"
    moving = variants_of(["s.c=2*frame", "s.d=5,6"], frames="3:4")
    assert [variant.label for variant in moving] == [
        "d 5, frame 3", "d 5, frame 4", "d 6, frame 3", "d 6, frame 4"
    ]  # fmt: skip


def test_grid_zip_rows_and_frames(tmp_path):
    def values(*args, **more):
        return [dict(variant.values) for variant in variants_of(*args, **more)]

    assert values(["a=1,2", "b=x,y"]) == [
        {"a": "1", "b": "x"}, {"a": "1", "b": "y"}, {"a": "2", "b": "x"}, {"a": "2", "b": "y"}
    ]  # fmt: skip
    assert values(["a=1,2", "b=x,y", "c=5"], together=True) == [
        {"a": "1", "b": "x", "c": "5"}, {"a": "2", "b": "y", "c": "5"}
    ]  # fmt: skip
    with pytest.raises(InputError, match="--zip wants as many or one"):
        variants_of(["a=1,2", "b=1,2,3"], together=True)
    rows = tmp_path / "rows.csv"
    rows.write_text('a,b\n1,"[1,2,3]"\n\n2,x\n')
    assert values(["c=7"], rows=rows) == [
        {"a": "1", "b": "[1,2,3]", "c": "7"},
        {"a": "2", "b": "x", "c": "7"},
    ]
    rows.write_text("label,a\nmatte,1\n,2\nmatte,3\n")
    with pytest.raises(InputError, match="2 rows have the label 'matte'"):
        variants_of([], rows=rows)
    rows.write_text("a,b\n1\n")
    with pytest.raises(InputError, match="row 2 has 1 cells"):
        variants_of([], rows=rows)
    spread = variants_of(["s.c=1:100:4log", "s.d=0.12345678,0.12345679"])
    assert [variant.label for variant in spread[:3]] == [
        "c 1, d 0.12345678", "c 1, d 0.12345679", "c 4.642, d 0.12345678"
    ]  # fmt: skip
    assert spread[2].values["s.c"] == "4.64158883361"
    moving = variants_of(["a=[cos(frame*0), frame/2, 3]"], frames="2:6:2")
    assert [(v.frame, v.values["a"]) for v in moving] == [
        (2, "[1, 1, 3]"),
        (4, "[1, 2, 3]"),
        (6, "[1, 3, 3]"),
    ]
    for wrong in ("3:1", "1", "0:4:0", "a:b"):
        with pytest.raises(InputError):
            variants_of([], frames=wrong)


def test_formulas_compute_and_do_nothing_else():
    assert at_frame("a", "sqrt(frame)", 9) == "3"
    assert at_frame("a", "[1, [frame, max(frame, 4)]]", 3) == "[1, [3, 4]]"
    assert at_frame("a", "framework", 3) == "framework"
    assert at_frame("a", "'frame.obj'", 3) == "'frame.obj'"
    assert at_frame("a", "time * 2", 3, fps=12) == "0.5"
    for wrong in ("frame.real", "__import__('os') + frame", "frame +"):
        with pytest.raises(InputError, match="a="):
            at_frame("a", wrong, 3)


def test_a_formula_without_a_value_at_a_frame_is_a_fault_of_this_frame_alone():
    (first, second) = variants_of(["camera.position=near:[0,1/frame,4]"], frames="0:1")
    assert second.values == {"camera.position": "[0, 1, 4]"}
    assert first.values == {"camera.position": '[0, {curve: formula, value: "1/frame"}, 4]'}
    assert first.names == {"camera.position": "near"}


def test_two_values_of_a_path_have_different_names():
    with pytest.raises(InputError, match="-D a=x:1,2,x:3: two values are called 'x'"):
        axis_of("a=x:1,2,x:3")


def test_values_of_a_path_are_given_in_one_place(tmp_path):
    rows = tmp_path / "r.csv"
    rows.write_text("a\n1\n2\n")
    for words in ({"texts": ["a=1,2", "a=3,4"], "together": True}, {"texts": ["a=3,4"], "rows": rows}):
        with pytest.raises(InputError, match="a: has values twice"):
            variants_of(**words)
    assert [each.values["a"] for each in variants_of(["a=1", "a=2"])] == ["2"]  # the last, as in a render


def test_commas_inside_brackets_and_quotes_part_nothing():
    assert split_at_commas("f(a,b),[c,d],'e,f',g") == ["f(a,b)", "[c,d]", "'e,f'", "g"]
