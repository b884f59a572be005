"""YAML text becomes plain data with places, within limits, whatever the text."""

from __future__ import annotations

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from illumcli.scene import source
from illumcli.scene.source import read


@pytest.fixture(params=["C", "Python"])
def parser(request, monkeypatch):
    """Both parsers of PyYAML: the one in C may be missing."""
    if request.param == "Python":
        monkeypatch.setattr(source, "_LOADER", yaml.SafeLoader)
    elif not yaml.__with_libyaml__:
        pytest.skip("PyYAML was built without libyaml")


def plain(text: str):
    node, problems = read(text.encode(), "s.yaml")
    assert problems == []
    return node.plain()


def faults(text: str | bytes) -> list[str]:
    _, problems = read(text if isinstance(text, bytes) else text.encode(), "s.yaml")
    return [str(problem) for problem in problems]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("1.0e3", 1000.0),
        ("1e-3", 0.001),
        (".5", 0.5),
        ("5.", 5.0),
        ("-2.5E+1", -25.0),
        ("012", 12),
        ("0o14", 12),
        ("0x1f", 31),
        ("+7", 7),
        ("1:30", "1:30"),
        ("2001-01-01", "2001-01-01"),
        ("1_000", "1_000"),
        ("no", "no"),
        ("yes", "yes"),
        ("on", "on"),
        ("true", True),
        ("False", False),
        ("TRUE", True),
        ("false", False),
        ("FALSE", False),
        ("Null", None),
        ("NULL", None),
        ("'3' ", "3"),
        ("~", None),
        ("null", None),
        ("", None),
        ("'1'", "1"),
        ('"true"', "true"),
        ("-0x1f", "-0x1f"),
        ("e3", "e3"),
        (".", "."),
    ],
)
def test_scalars_follow_the_core_schema_of_yaml_1_2(parser, text, value):
    found = plain(f"a: {text}")["a"]
    assert found == value
    assert type(found) is type(value)


def test_keys_are_text():
    assert plain("{1: a, no: b, null: c, 1e3: d}") == {"1": "a", "no": "b", "null": "c", "1e3": "d"}


def test_every_key_and_value_has_a_place(parser):
    node, _ = read(b"a:\n  - x\n  - {b: 1}\n", "s.yaml")
    inner = node.find(("a", 1, "b"))
    assert (str(inner.key), str(inner.place), str(inner.at)) == ("s.yaml:3:6", "s.yaml:3:9", "s.yaml:3:6")
    assert str(node.find(("a", 0)).at) == "s.yaml:2:5"
    assert node.find(("a", 7)) is None
    assert node.find(("a", "b")) is None
    assert [path for path, _ in node.places()] == [(), ("a",), ("a", 0), ("a", 1), ("a", 1, "b")]


def test_columns_count_characters_after_a_byte_order_mark(parser):
    node, _ = read("\ufeffé: {ü: 1}".encode(), "s.yaml")
    assert str(node.find(("é", "ü")).at) == "s.yaml:1:5"


def test_aliases_and_merge_keys(parser):
    tree = plain("a: &x {p: 1, q: 2}\nb: *x\nc: {<<: *x, q: 3}\nd: {<<: [{p: 5}, *x]}\n")
    assert tree["b"] == {"p": 1, "q": 2}
    assert tree["c"] == {"p": 1, "q": 3}
    assert tree["d"] == {"p": 5, "q": 2}


NINE = {  # the rows of the YAML table in the notes on robustness; each must be refused, fast
    "deep flow": (b"[" * 200_000, "s.yaml:1:33: nested deeper than 32 levels"),
    "deep lines": (b"[\n" * 100_000, "s.yaml:33:1: nested deeper than 32 levels"),
    "alias bomb": (
        b"a0: &a0 [1, 2]\n"
        + b"".join(b"a%d: &a%d [*a%d, *a%d]\n" % (i, i, i - 1, i - 1) for i in range(1, 30)),
        "the aliases expand to more than 10 times the text",
    ),
    "long integer": (b"a: " + b"9" * 5000, "s.yaml:1:1: a: a number of 5000 digits; at most 64 count"),
    "cycle": (b"a: &a [*a]", "s.yaml:1:8: a.0: the alias *a is inside its own anchor"),
    "repeated key": (
        b"a: 1\nb: 2\na: 3",
        "s.yaml:3:1: the key 'a' stands twice, first in line 1; remove one",
    ),
    "infinite": (b"a: .inf", "s.yaml:1:1: a: must be a finite number, is .inf"),
    "not a number": (b"a: [1, .NaN]", "s.yaml:1:8: a.1: must be a finite number, is .NaN"),
    "overflow": (b"a: 1.0e+400", "s.yaml:1:1: a: must be a finite number, is 1.0e+400"),
}


@pytest.mark.parametrize("row", NINE)
def test_nine_rows_are_refused(parser, row):
    text, fact = NINE[row]
    (found,) = faults(text)
    assert fact in found


@pytest.mark.parametrize("limit", [33, 64, 1000])
@pytest.mark.parametrize("row", ["deep flow", "deep lines"])
def test_the_depth_limit_is_ours_wherever_the_parsers_own_stands(parser, monkeypatch, limit, row):
    parse = source.yaml.parse

    def limited(text, **options):
        """As newer parsers scan: a depth of their own is met before the first event is handed out."""
        depth = 0
        for index, character in enumerate(text):
            depth += character == "["
            if depth > limit:
                line = text.count("\n", 0, index)
                mark = source.yaml.Mark("", index, line, index - text.rfind("\n", 0, index) - 1, None, None)
                raise source.yaml.scanner.ScannerError("while increasing flow level", mark, "too deep", mark)
        return parse(text, **options)

    monkeypatch.setattr(source.yaml, "parse", limited)
    text, fact = NINE[row]
    assert faults(text) == [fact]


@pytest.mark.parametrize(
    "text", [b"{a: " * 50_000, b"- " * 100_000, b"? " * 100_000, b"&a " * 50_000, b"!a " * 50_000]
)
def test_deep_or_repeated_marks_end_soon(text):
    assert faults(text)


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("a: b: c", "s.yaml:1:5: not YAML: mapping values are not allowed"),
        ("a:\n\tb: 1", "s.yaml:2:1: not YAML:"),
        ("a: 'x\nb: 1", "close the quote"),
        ("a: [1, 2\nb: 3", "s.yaml:2:2: not YAML:"),
        ("a: 1\n b: 2", "check the indentation"),
        ("a: @x", "quote text that begins with a sign"),
        ("a: 1\n---\nb: 2", "s.yaml:2:1: a second document; a scene file holds one"),
        ("? [a]\n: 1", "s.yaml:1:3: a key must be text"),
        (
            "a: !!python/object:os.system x",
            "s.yaml:1:1: a: the tag tag:yaml.org,2002:python/object:os.syst… is not",
        ),
        ("a: !!float 1", "write the plain value"),
        ("a: *x", "s.yaml:1:1: a: the alias *x has no anchor &x before it"),
        ("a: {<<: 3}", "<< must name mappings"),
        ("a: \x00", "s.yaml:1:4: character U+0000 is not text"),
        (b"a: 1\nb: \xff", "s.yaml:2:4: byte 0xff is not UTF-8"),
        ("a: 1".encode("utf-16"), "is not UTF-8; save the file as UTF-8"),
        ('a: "\\ud800"\nb: .inf', ""),
    ],
)
def test_other_faults_have_place_fact_and_way_out(parser, text, fact):
    (found, *_) = faults(text)
    assert fact in found
    assert found.isprintable()


def test_all_faults_of_a_readable_text_at_once():
    assert faults("a: .nan\na: 2\nb: !x 3\nc: *d\ne: .inf\n") == [
        "s.yaml:1:1: a: must be a finite number, is .nan",
        "s.yaml:2:1: the key 'a' stands twice, first in line 1; remove one",
        "s.yaml:3:1: b: the tag !x is not read; write the plain value",
        "s.yaml:4:1: c: the alias *d has no anchor &d before it",
        "s.yaml:5:1: e: must be a finite number, is .inf",
    ]


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        (b"a: [" + b"1," * 100_000 + b"]", "more than 100000 parts"),
        (b"a: &x 1\nb: [" + b"*x," * 101 + b"]", "more than 100 aliases"),
        (b" " * (2**20 + 1), "larger than 1048576 bytes"),
        (b"a: &a " + b"[" * 20 + b"]" * 20 + b"\nb: " + b"[" * 20 + b"*a" + b"]" * 20, "by aliases"),
    ],
)
def test_limits(text, fact):
    (found,) = faults(text)
    assert fact in found


def test_at_the_limits_all_is_read():
    assert plain("a: [" + "1," * 99_000 + "]")["a"] == [1] * 99_000
    deep = plain("[" * 32 + "]" * 32)
    for _ in range(31):
        (deep,) = deep
    assert deep == []


@pytest.mark.parametrize("text", ["", "# only a comment\n", "---\n"])
def test_an_empty_text_is_null(text):
    assert plain(text) is None


@given(st.binary(max_size=200) | st.text("[]{}:,-&*!'\"\n ab1.%?|>#\t<", max_size=60).map(str.encode))
def test_any_bytes_give_data_or_problems(text):
    node, problems = read(text, "s.yaml")
    assert node is not None or problems
    assert all(str(problem).isprintable() for problem in problems)
    if node:
        node.plain()
