"""JPEG images in memory."""

from __future__ import annotations

import os

import numpy as np
import pytest

from illumcli.images.jpeg import jpeg_bytes, write_jpeg
from illumcli.images.reader import read_image


@pytest.mark.parametrize("has_memory_files", [True, False])
@pytest.mark.parametrize("channels", [1, 3])
def test_bytes_are_those_of_the_file_and_show_the_pixels(tmp_path, monkeypatch, channels, has_memory_files):
    if not has_memory_files:
        monkeypatch.delattr(os, "memfd_create", raising=False)
        monkeypatch.setenv("TMPDIR", str(tmp_path))
    y, x = np.mgrid[:24, :40]
    pixels = np.stack([5 * x, 8 * y, 3 * (x + y)], axis=-1).astype(np.uint8)[..., :channels]
    before = len(os.listdir("/proc/self/fd")) if os.path.exists("/proc/self/fd") else None
    data = jpeg_bytes(pixels)
    if before is not None:
        assert len(os.listdir("/proc/self/fd")) == before
    write_jpeg(tmp_path / "picture.jpg", pixels)
    assert data == (tmp_path / "picture.jpg").read_bytes()
    shown = read_image(str(tmp_path / "picture.jpg")).channels
    names = ["Y"] if channels == 1 else ["R", "G", "B"]
    assert np.abs(255 * np.stack([shown[name] for name in names], axis=-1) - pixels).max() < 24
    assert [path.name for path in tmp_path.iterdir()] == ["picture.jpg"]
