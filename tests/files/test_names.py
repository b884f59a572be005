"""Names of an image set: fields filled in, safe, unique."""

from __future__ import annotations

import os
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.errors import InputError
from illumcli.files.names import check_unique, expand, frame_field, number_form, with_forms

VALUES = {"scene": "teapot", "camera": "front", "layer": "beauty", "frame": 7, "materials.clay.sigma": 0.3}


@pytest.mark.parametrize(
    ("pattern", "name"),
    [
        ("{scene}.{camera}.png", "teapot.front.png"),
        ("out/{layer}.{frame:04d}.exr", "out/beauty.0007.exr"),
        ("{scene}_{materials.clay.sigma}.exr", "teapot_0.3.exr"),
        ("{materials.clay.sigma:.3f}.exr", "0.300.exr"),
        ("plain.png", "plain.png"),
        ("{{{frame}}}.png", "{7}.png"),
        ("../{scene}/a.png", "../teapot/a.png"),
    ],
)
def test_fields_become_values(pattern, name):
    assert expand(pattern, VALUES) == name


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ([8, 32, 128], ["008", "032", "128"]),
        ([7], ["7"]),
        ([0.1, 0.133333333333, 0.2], ["0.1000", "0.1333", "0.2000"]),
        ([1.5, 10], ["01.5", "10.0"]),
        ([0, 1 / 3, 12], ["00.0000", "00.3333", "12.0000"]),
        ([133.3333333, 0.5], ["133.3", "000.5"]),
        ([-0.5, 0, 0.25], ["-0.50", "00.00", "00.25"]),
        ([1 / 3, 1 / 3 + 1e-9], ["0.333333333", "0.333333334"]),
        ([1e-12, 1e12], ["1e-12", "1000000000000.0"]),
    ],
)
def test_numbers_in_names_have_one_width(values, names):
    form = number_form(values)
    assert [format(value, form) for value in values] == names


@given(st.lists(st.one_of(st.integers(0, 10**6), st.floats(0, 1e6)), min_size=2, unique=True))
def test_names_with_numbers_sort_and_differ(values):
    form = number_form(values)
    if form:
        names = [format(value, form) for value in sorted(values)]
        assert names == sorted(set(names))
        assert len({len(name) for name in names}) == 1


def test_a_field_keeps_a_form_of_its_own():
    pattern = with_forms("{{a}}{a}-{b:.2f}-{b}-{c}.png", {"a": "04d", "b": "05.1f", "d": "d"})
    assert pattern == "{{a}}{a:04d}-{b:.2f}-{b:05.1f}-{c}.png"
    assert [frame_field(frames) for frames in ([], [3], [7, 12345])] == ["", ".{frame:04d}", ".{frame:05d}"]


@pytest.mark.parametrize(
    ("value", "safe"),
    [
        ("a/b\\c", "a_b_c"),
        ("..", "_"),
        (".hidden", "_hidden"),
        ("end.", "end_"),
        ("", "_"),
        ([0.5, 0.25, 1], "_0.5_0.25_1_"),
        (-1.5e-07, "-1.5e-07"),
        ("Ödön 2", "Ödön_2"),
        ("a\0\nb", "a_b"),
        (True, "True"),
    ],
)
def test_values_are_made_safe(value, safe):
    assert expand("{x}", {"x": value}) == safe


@given(st.dictionaries(st.from_regex(r"[a-z][a-z0-9_.]{0,8}", fullmatch=True), st.text(), min_size=1))
def test_no_value_adds_a_folder_or_an_empty_name(values):
    for field in values:
        name = expand(f"{{{field}}}", values)
        assert name
        assert os.path.basename(name) == name
        assert name not in (".", "..")
        assert name.isprintable()


@given(st.text())
def test_any_pattern_gives_a_name_or_an_input_error(pattern):
    try:
        name = expand(pattern, VALUES)
    except InputError as error:
        name = str(error)
    assert name == pattern or re.search(r"[{}\0]", pattern)


@given(
    st.text(alphabet=st.characters(blacklist_characters="{}", blacklist_categories=["Cc", "Cs"])),
    st.integers(0, 9999),
)
def test_padded_numbers_sort_as_names(literal, number):
    names = [expand(literal.replace("{", "") + "{frame:05d}.exr", {"frame": n}) for n in (number, number + 1)]
    assert names == sorted(names)


@pytest.mark.parametrize(
    ("pattern", "problem"),
    [
        ("{scen}.png", "no field 'scen'; did you mean 'scene'?"),
        ("{materials.clay.sigm}.png", "no field 'materials.clay.sigm'; did you mean 'materials.clay.sigma'?"),
        ("{scene:04d}.png", "'04d' does not fit scene = 'teapot'"),
        ("{scene.png", "lone '{' at character 1; write '{{' for a brace"),
        ("scene}.png", "lone '}' at character 6; write '}}' for a brace"),
    ],
)
def test_wrong_patterns_name_fault_and_way_out(pattern, problem):
    with pytest.raises(InputError, match=re.escape(problem)):
        expand(pattern, VALUES)


@pytest.mark.parametrize(
    ("pattern", "problem"),
    [
        ("{frame:0300000000d}.png", "'0300000000d' makes frame longer than any name; use a form"),
        ("{materials.clay.sigma:.9999999f}", "makes materials.clay.sigma longer than any name"),
        ("{scene:>100000}", "makes scene longer than any name"),
        ("a\0b.png", "a\0b.png: character U+0000 is no part of any name; take it out"),
        ("x" * 5000, "makes a name of 5000 letters; no system takes more than 4096"),
        ("{scene:_>900}" * 5, "makes a name of 4500 letters"),
    ],
)
def test_bombs_and_controls_in_patterns_are_refused_in_a_short_line(pattern, problem):
    with pytest.raises(InputError, match=re.escape(problem)) as caught:
        expand(pattern, VALUES)
    assert len(str(caught.value)) < 300


def test_all_faults_of_a_pattern_are_told_at_once():
    with pytest.raises(InputError) as caught:
        expand("{a}{scene:d}{", VALUES)
    assert len(caught.value.problems) == 3


def test_values_are_not_looked_into():
    with pytest.raises(InputError, match=r"no field 'scene\.__class__'"):
        expand("{scene.__class__}", VALUES)


def test_unique_names_pass():
    check_unique(["a.exr", "b.exr", "out/a.exr"])


@pytest.mark.parametrize(
    "names",
    [["a.exr", "a.exr"], ["./a.exr", "a.exr"], ["x//\u00e9.exr", "x/e\u0301.exr"]],
)
def test_names_that_some_file_system_takes_for_one_collide(names):
    with pytest.raises(InputError, match=r"the name of 2 images \(1, 2\); add a field"):
        check_unique(names)


def test_names_that_differ_in_case_alone_collide():
    """Two cameras, or two lights, may be called so; files may not."""
    with pytest.raises(InputError, match=r"A\.png: the name of 2 images \(1, 2\); they differ only in case"):
        check_unique(["A.png", "a.png"])


def test_every_collision_is_listed():
    with pytest.raises(InputError) as caught:
        check_unique(["a", "b", "a", "c", "b", "a", *("d" * 8), *("e" * 5)])
    assert [p.split(";")[0] for p in caught.value.problems] == [
        "a: the name of 3 images (1, 3, 6)",
        "b: the name of 2 images (2, 5)",
        "d: the name of 8 images (7, 8, 9, 10, 11, ...)",
        "e: the name of 5 images (15, 16, 17, 18, 19)",
    ]
