"""Text: every letter is drawn without overlaps, stands where it should and casts no crooked faces."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from illumcli.geometry.polygon_normals import area_vectors, polygon_normals
from illumcli.geometry.shapes._letters import LETTERS
from illumcli.geometry.shapes._strokes import middle_lines, thick_lines
from illumcli.geometry.shapes.text import Text
from illumcli.geometry.triangulate import triangulate


def text(**keys):
    return Text.model_validate(keys)


def extent(**keys):
    points = text(**keys).mesh().vertices
    return points.min(axis=0), points.max(axis=0)


def area_of(mesh):
    return np.linalg.norm(area_vectors(mesh), axis=1).sum() / 2


def area_inside(lines, radius, step=0.02):
    """Area within `radius` of polylines, from points of a grid."""
    low = np.min([line.min(axis=0) for line in lines], axis=0) - radius
    high = np.max([line.max(axis=0) for line in lines], axis=0) + radius
    x, y = np.meshgrid(*(np.arange(a, b, step) for a, b in zip(low, high, strict=True)))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    inside = np.zeros(len(points), bool)
    for line in lines:
        for a, b in pairwise(line):
            share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)[:, None]
            inside |= ((points - a - share * (b - a)) ** 2).sum(axis=1) < radius**2
    return inside.sum() * step**2


def test_ascii_is_complete():
    assert {chr(code) for code in range(33, 127)} <= set(LETTERS)


@pytest.mark.parametrize("weight", [0.01, 0.12, 0.15])
def test_no_face_of_a_letter_is_turned_or_crossed(weight):
    for letter, drawing in LETTERS.items():
        points, faces = thick_lines(middle_lines(drawing), 3 * weight / (1 - weight))
        for face in faces:
            to_next = np.roll(points[face], -1, axis=0) - points[face]
            turns = cross(to_next, np.roll(to_next, -1, axis=0))
            assert cross(points[face], np.roll(points[face], -1, axis=0)).sum() > 1e-6, letter
            assert len(face) != 4 or (turns > 0).all(), letter


def cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@pytest.mark.parametrize("letter", "BKQRSagk38&@#*")
def test_the_faces_cover_what_lies_near_the_middle_lines_and_nothing_twice(letter):
    lines = middle_lines(LETTERS[letter])
    area = area_of(text(text=letter, weight=0.15, height=6 + 6 * 0.15 / 0.85).mesh())
    assert area == pytest.approx(area_inside(lines, 3 * 0.15 / 0.85), rel=0.015)


def test_letters_stand_on_the_line_and_have_the_height_asked_for():
    low, high = extent(text="HI", height=0.4, weight=0.08)
    np.testing.assert_allclose([low[1], high[1]], [0, 0.4], atol=1e-12)
    assert low[0] == pytest.approx(0)
    np.testing.assert_array_equal([low[2], high[2]], 0)


@pytest.mark.parametrize(("align", "share"), [("left", 0), ("centre", 0.5), ("right", 1)])
def test_every_line_is_aligned_at_x_0(align, share):
    for lines in ("HIHI", "HI"):
        low, high = extent(text=lines, align=align)
        assert low[0] + share * (high[0] - low[0]) == pytest.approx(0, abs=1e-12)


def test_a_line_stands_below_the_one_before():
    low, high = extent(text="H\nH")
    assert high[1] - low[1] == pytest.approx(1 + 1.8)


def test_letters_face_plus_z_and_rise_towards_it():
    facing = polygon_normals(text(text="a&8").mesh())
    np.testing.assert_allclose(facing[:, 2], 1, atol=1e-12)
    mesh = text(text="a&8", depth=0.3).mesh()
    assert mesh.vertices[:, 2].min() == 0
    assert mesh.vertices[:, 2].max() == 0.3
    triangles = mesh.vertices[mesh.corners[triangulate(mesh).corners]]
    assert np.linalg.det(triangles).sum() / 6 == pytest.approx(0.3 * area_of(text(text="a&8").mesh()))


def test_a_number_is_written_as_it_is():
    assert text(text=320).text == "320"
    assert text(text=0.5).text == "0.5"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"text": "5 €, Ж"}, "there is no letter for Ж €; there are A B"),
        ({"text": " \n"}, "must have a letter that is not a space"),
        ({"text": True}, "valid string"),
        ({"text": "A", "weight": 0.4}, "less than or equal to 0.15"),
        ({"text": "A", "align": "middle"}, "'left', 'centre' or 'right'"),
    ],
)
def test_faults_are_named(wrong, message):
    with pytest.raises(ValidationError, match=message):
        text(**wrong)
