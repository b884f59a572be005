"""Which picture stands where on the contact sheet of a sweep."""

from __future__ import annotations

from illumcli.commands.sweep_sheet import sheet_of
from illumcli.scene.variants import variants_of


def test_what_varies_fastest_stands_along_x():
    sheet = sheet_of(variants_of(["a=1,2", "m.b=x,y,z"]))
    assert sheet.cells == ((0, 1, 2), (3, 4, 5))
    assert sheet.column_heads == ("b x", "b y", "b z")
    assert sheet.row_heads == ("a 1", "a 2")
    assert sheet.captions == ()


def test_three_paths_and_frames():
    sheet = sheet_of(variants_of(["a=1,2", "b=x,y", "c=5"], frames="0:2"))
    assert sheet.cells == ((0, 1, 2), (3, 4, 5), (6, 7, 8), (9, 10, 11))
    assert sheet.column_heads == ("frame 0", "frame 1", "frame 2")
    assert sheet.row_heads == ("a 1, b x", "a 1, b y", "a 2, b x", "a 2, b y")


def test_pictures_that_are_no_grid_follow_each_other(tmp_path):
    one = sheet_of(variants_of(["a=1:5:5"]))
    assert one.cells == ((0, 1, 2), (3, 4, None))
    assert one.captions == ("a 1", "a 2", "a 3", "a 4", "a 5")
    assert sheet_of(variants_of(["a=1,2", "b=x,y"]), columns=3).cells == ((0, 1, 2), (3, None, None))
    assert sheet_of(variants_of(["a=1,2", "b=x,y"], together=True)).captions == ("a 1, b x", "a 2, b y")
    rows = tmp_path / "r.csv"
    rows.write_text("a,b\n1,1\n1,2\n2,1\n2,1\n")
    assert len(sheet_of(variants_of([], rows=rows)).captions) == 4
    assert sheet_of(variants_of([])).captions == ("variant 1",)
