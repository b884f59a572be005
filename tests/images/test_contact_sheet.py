"""Contact sheets: every picture in its place, with its texts."""

from __future__ import annotations

import os
from functools import partial

import numpy as np
import pytest

from illumcli.files.reports import report_contents
from illumcli.files.seal import is_sealed
from illumcli.images.contact_sheet import write_contact_sheet
from illumcli.images.reader import read_image
from illumcli.images.sheet_layout import GAP, MAX_PIXELS, MAX_SIDE, Sheet, laid_out

GRID = Sheet(((0, 1), (2, None)), (), ("x 1", "x 2"), ("y 1", "y 2"))
SIZES = [(30, 50), (20, 90), (40, 60)]
SHADES = [60, 120, 180]


def pictures(channels=3):
    def read(number):
        return np.full((*SIZES[number], channels), SHADES[number], np.uint8)

    return [partial(read, number) for number in range(3)]


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("captions", [(), ("a", "b", "a longer caption than the picture is wide")])
def test_every_picture_has_its_own_size_in_its_place(tmp_path, channels, captions):
    heads = ((), ()) if captions else (GRID.column_heads, GRID.row_heads)
    sheet = Sheet(GRID.cells, captions, *heads)
    write_contact_sheet(tmp_path / "s.png", sheet, pictures(channels), SIZES, "c")
    layout = laid_out(sheet, SIZES)
    image = read_image(tmp_path / "s.png")
    assert (image.width, image.height) == (layout.width, layout.height)
    red = np.rint(image.channels["R"] * 255).astype(int)
    y, seen = 0, []
    for row in layout.rows:
        for each in row.pictures:
            top = y + each.y
            shown = red[top : top + each.height, each.x : each.x + each.width]
            assert shown.shape == SIZES[each.picture]
            assert (shown == SHADES[each.picture]).all()
            shown[:] = 255
            seen.append(each.picture)
        y += row.height
    assert seen == [0, 1, 2]
    assert red.min() < 100  # letters


def test_texts_stand_beside_their_pictures():
    layout = laid_out(GRID, SIZES)
    heads, first, second = layout.rows
    assert [text.text for text in heads.texts] == ["x 1", "x 2"]
    assert [text.x for text in heads.texts] == [picture.x for picture in first.pictures]
    assert [row.texts[0].text for row in (first, second)] == ["y 1", "y 2"]
    assert first.texts[0].x < first.pictures[0].x - GAP
    long = laid_out(Sheet(((0, 1, 2),), ("a" * 99,) * 3), SIZES)
    ends = [picture.x for picture in long.rows[0].pictures[1:]]
    for text, end in zip(long.rows[0].texts, ends, strict=False):
        assert text.text.endswith("a…")
        assert text.x + 8 * len(text.text) <= end


@pytest.mark.parametrize("size", [(9, 30000), (30000, 9), (9000, 16000)])
def test_large_sheets_are_reduced_by_one_factor(size):
    layout = laid_out(Sheet(((0, 1),), ("a", "b")), [size, (100, 200)])
    assert max(layout.width, layout.height) <= MAX_SIDE
    assert layout.width * layout.height <= MAX_PIXELS
    large, small = layout.rows[0].pictures
    assert large.width / size[1] == pytest.approx(small.width / 200, abs=1 / 9)
    assert large.width < size[1] or large.height < size[0]


@pytest.mark.parametrize("kind", ["svg", "pdf"])
def test_drawings_hold_text_and_content_and_are_equal_each_time(tmp_path, kind):
    pytest.importorskip("matplotlib")
    files = [tmp_path / f"{name}.{kind}" for name in "ab"]
    for file in files:
        write_contact_sheet(file, GRID, pictures(), SIZES, "5a")
    assert files[0].read_bytes() == files[1].read_bytes()
    assert report_contents(files[0]) == ["5a"]
    assert is_sealed(files[0])
    if kind == "svg":
        assert ">y 2</text>" in files[0].read_text()
    files[1].write_bytes(files[1].read_bytes().replace(b"0 0 0", b"0 0 1", 1) + b"%")
    assert not is_sealed(files[1])


def test_a_picture_that_cannot_be_read_leaves_no_file(tmp_path):
    def broken():
        raise OSError("gone")

    with pytest.raises(OSError, match="gone"):
        write_contact_sheet(tmp_path / "s.png", GRID, [*pictures()[:2], broken], SIZES, "c")
    assert os.listdir(tmp_path) == []
