"""Parameters and measures of a report."""

from __future__ import annotations

from illumcli.html_report.columns import measures_of, parameters_of, short_labels, short_numbers
from illumcli.html_report.entries import Contents, Entry


def contents(*rows, measures=({},)):
    entries = tuple(
        Entry("", values, "", "rendered", "", measures=measures[k % len(measures)])
        for k, values in enumerate(rows)
    )
    return Contents("a", entries, 0.0, 1.0)


def test_numbers_are_in_their_order_and_texts_as_they_come():
    rows = ({"a": "10", "b": "ward"}, {"a": "9", "b": "phong"}, {"a": "1e1", "b": "ward"})
    numbers, texts = parameters_of(contents(*rows))
    assert numbers.values == ("9", "10", "1e1")
    assert numbers.at == (1, 0, 2)
    assert numbers.is_numeric
    assert texts.values == ("ward", "phong")
    assert not texts.is_numeric


def test_numbers_are_shown_with_as_few_digits_as_tell_them_apart():
    assert short_numbers(["0.0666666666667", "0.2", "512"]) == ("0.06667", "0.2", "512")
    assert short_numbers(["0.1234561", "0.1234562"]) == ("0.1234561", "0.1234562")
    assert short_numbers(["1000000", "100000"]) == ("1e+06", "1e+05")


def test_a_path_that_does_not_vary_is_no_parameter():
    assert parameters_of(contents({"a": "1"}, {"a": "1"})) == []
    (only,) = parameters_of(contents({"a": "1"}, {}))
    assert only.at == (0, -1)


def test_a_value_that_is_not_finite_is_a_text():
    (only,) = parameters_of(contents({"a": "1"}, {"a": "inf"}))
    assert not only.is_numeric


def test_labels_are_as_short_as_they_can_be():
    paths = ["materials.a.exponent", "materials.b.exponent", "film.exposure", "exposure"]
    assert short_labels(paths) == ["a.exponent", "b.exponent", "film.exposure", "exposure"]


def test_measures_that_are_missing_or_not_finite_are_none():
    (rmse,) = measures_of(contents({}, {}, {}, measures=({"rmse": 0.5}, {}, {"rmse": float("nan")})))
    assert rmse.values == (0.5, None, None)
    assert rmse.limits == (0.5, 0.5)
    assert not rmse.varies
