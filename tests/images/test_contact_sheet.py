"""Contact sheets: every picture in its cell, over its label."""

from __future__ import annotations

import os

import numpy as np
import pytest

from illumcli.images.contact_sheet import CELL_WIDTH, write_contact_sheet
from illumcli.images.reader import read_image


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_a_sheet_shows_every_picture_in_a_cell_with_its_label(tmp_path, count):
    shades = np.linspace(40, 240, count).astype(int).tolist()
    pictures = [np.full((20 + 10 * k, 40, 3 if k % 2 else 1), shades[k], np.uint8) for k in range(count)]
    write_contact_sheet(
        tmp_path / "s.png", iter(pictures), [f"{'a long label ' * 9}{k}" for k in range(count)], "c"
    )
    sheet = read_image(tmp_path / "s.png")
    assert sheet.width % (CELL_WIDTH + 8) == 0
    columns = sheet.width // (CELL_WIDTH + 8)
    tall = sheet.height // -(-count // columns)
    red = np.rint(sheet.channels["R"] * 255).astype(int)
    for k in range(count):
        y, x = k // columns * tall, k % columns * (CELL_WIDTH + 8)
        height = round(CELL_WIDTH * len(pictures[k]) / 40)
        cell = red[y : y + tall, x : x + CELL_WIDTH + 8]
        assert (cell[10 : height - 10, 10:-10] == shades[k]).all()
        assert (cell[:, :4] == 255).all()
        assert cell[height + 8 : height + 28].min() < 100  # letters
    assert (red[(count - 1) // columns * tall :, count % columns * (CELL_WIDTH + 8) :] == 255).all() or (
        count % columns == 0
    )


def test_a_sheet_needs_a_label_for_every_picture(tmp_path):
    with pytest.raises(ValueError, match="zip"):
        write_contact_sheet(tmp_path / "s.png", [np.zeros((4, 4, 3), np.uint8)], ["a", "b"], "c")
    assert os.listdir(tmp_path) == []
