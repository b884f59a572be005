"""Images on disk: bit-exact round trips by bands, nothing half-written, damaged files refused."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from illumcli.color import Texels
from illumcli.errors import IllumError, InputError, OutputError
from illumcli.files.seal import is_sealed
from illumcli.film.channels import bits_of, channel_types, group_by_layer
from illumcli.images import exr, png, reader
from illumcli.images.format import RESERVED
from illumcli.images.png import read_texts
from illumcli.images.reader import read_image, read_metadata, read_texture, texture_bytes
from illumcli.images.writer import ImageWriter

LAYERED = ("R", "G", "B", "A", "Z", "P.X", "P.Y", "P.Z", "N.X", "key.R", "objectId")


def noise(height, width, channels, seed=1):
    return np.random.default_rng(seed).normal(size=(height, width, channels)).astype(np.float32)


def write(path, pixels, types, rows=None, metadata=None):
    height, width, _ = pixels.shape
    with ImageWriter(path, width, height, types, metadata) as writer:
        for y in range(0, height, rows or height):
            writer.write_band(y, pixels[y : y + (rows or height)])
    return writer.close()


def linear(path, space=None):
    """(H, W, C) the values of a texture."""
    texels = read_texture(path, space)
    every = np.arange(texels.height * texels.width)
    return texels.at(every).reshape(texels.height, texels.width, -1)


def stored(pixels, kind):
    return pixels.astype(np.float16).astype(np.float32) if kind == "half" else pixels


# ------------------------------------------------------------------ round trips


@pytest.mark.parametrize("colour", ["half", "float"])
@pytest.mark.parametrize(
    "names", [LAYERED, ("R", "G", "B"), ("Z",), ("zeta.R", "alpha.R", "A", "B", "G", "R")]
)
def test_exr_gives_back_every_value_by_name(tmp_path, names, colour):
    pixels, types = noise(37, 29, len(names)), channel_types(names, colour)
    write(tmp_path / "a.exr", pixels, types)
    image = read_image(tmp_path / "a.exr")
    assert (image.width, image.height, image.encoded) == (29, 37, False)
    assert set(image.channels) == set(names)
    for c, name in enumerate(names):
        np.testing.assert_array_equal(image.channels[name], stored(pixels[..., c], types[name]))


@settings(max_examples=20, deadline=None)
@given(
    pixels=st.lists(st.floats(-65504, 65504, width=16), min_size=6, max_size=6),
    data=st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=6, max_size=6),
)
def test_any_finite_number_survives(tmp_path_factory, pixels, data):
    path = tmp_path_factory.mktemp("any") / "a.exr"
    both = np.stack([np.array(pixels, np.float32), np.array(data, np.float32)], -1).reshape(2, 3, 2)
    write(path, both, {"R": "half", "Z": "float"})
    channels = read_image(path).channels
    np.testing.assert_array_equal(channels["R"], both[..., 0])
    np.testing.assert_array_equal(channels["Z"], both[..., 1])


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
@pytest.mark.parametrize("names", ["Y", "YA", "RGB", "RGBA"])
def test_png_gives_back_every_value(tmp_path, names, kind):
    top = np.iinfo(kind).max
    pixels = np.random.default_rng(2).integers(0, top + 1, (21, 17, len(names))).astype(kind)
    pixels[0, 0, -1] = 0  # colour under alpha 0 stays as well
    write(tmp_path / "a.png", pixels, dict.fromkeys(names, kind))
    image = read_image(tmp_path / "a.png")
    assert image.encoded
    assert tuple(image.channels) == tuple(names)
    for c, name in enumerate(names):
        np.testing.assert_array_equal(np.rint(image.channels[name] * top), pixels[..., c])


@pytest.mark.parametrize("rows", [1, 7, 16, 40])
def test_bands_make_the_same_file_as_the_whole(tmp_path, rows):
    pixels, types = noise(53, 31, len(LAYERED)), channel_types(LAYERED)
    write(tmp_path / "whole.exr", pixels, types)
    write(tmp_path / "bands.exr", pixels, types, rows)
    assert (tmp_path / "whole.exr").read_bytes() == (tmp_path / "bands.exr").read_bytes()
    integers = (np.abs(pixels[..., :3]) * 50).astype(np.uint8)
    write(tmp_path / "whole.png", integers, dict.fromkeys("RGB", "uint8"))
    write(tmp_path / "bands.png", integers, dict.fromkeys("RGB", "uint8"), rows)
    assert (tmp_path / "whole.png").read_bytes() == (tmp_path / "bands.png").read_bytes()


def test_lanes_in_any_memory_order_are_written_alike(tmp_path):
    pixels = noise(20, 10, 4)
    for names, kinds in (("RGBA", "half"), ("RGBA", "float")):
        types = dict.fromkeys(names, kinds)
        write(tmp_path / "c.exr", pixels, types)
        write(tmp_path / "f.exr", np.asfortranarray(pixels), types)
        assert (tmp_path / "c.exr").read_bytes() == (tmp_path / "f.exr").read_bytes()


def test_what_was_written_is_reported(tmp_path):
    written = write(tmp_path / "a.exr", noise(9, 9, 4), channel_types("RGBA"))
    assert written.path == tmp_path / "a.exr"
    assert written.bytes == (tmp_path / "a.exr").stat().st_size
    assert written.clamped == 0


def test_colour_beyond_half_is_clamped_and_counted(tmp_path):
    pixels = np.zeros((4, 4, 2), np.float32)
    pixels[0, 0, 0], pixels[1, 2, 0], pixels[:, :, 1] = 1e6, -7e4, 1e6
    written = write(tmp_path / "a.exr", pixels, {"R": "half", "Z": "float"}, rows=1)
    channels = read_image(tmp_path / "a.exr").channels
    assert written.clamped == 2
    assert channels["R"][0, 0] == 65504
    assert channels["R"][1, 2] == -65504
    assert (channels["Z"] == 1e6).all()
    write(tmp_path / "b.exr", pixels, {"R": "float", "Z": "float"})
    assert read_image(tmp_path / "b.exr").channels["R"][0, 0] == 1e6


def test_colour_is_half_and_data_single():
    types = channel_types(("R", "A", "key.G", "Z", "P.X", "obscurance.Y", "objectId"))
    assert list(types.values()) == ["half", "half", "half", "float", "float", "float", "float"]
    assert set(channel_types("RGBA", "float").values()) == {"float"}


def test_layers_are_told_by_name():
    assert group_by_layer(("R", "G", "B", "A", "Z", "P.X", "P.Y", "key.spec.R")) == {
        "beauty": ("R", "G", "B", "A"),
        "Z": ("Z",),
        "P": ("P.X", "P.Y"),
        "key.spec": ("key.spec.R",),
    }


# ------------------------------------------------------------------ metadata


def test_exr_metadata_survives(tmp_path):
    given = {
        "illum:seed": 7,
        "illum:samples": -3,
        "illum:seconds": 0.1,
        "illum:command": "illum render 'é'\nline",
        "illum:eye": (0.5, -1.0, 2.25),
        "illum:tile": (64, 64),
        "illum:lights": ("key", "fill"),
        "Software": "illum 0.2.0",
    }
    write(tmp_path / "a.exr", noise(3, 3, 3), channel_types("RGB"), metadata=given)
    found = read_metadata(tmp_path / "a.exr")
    assert {name: found.get(name) for name in given} == given
    assert found["oiio:ColorSpace"] == "lin_rec709_scene"
    assert read_image(tmp_path / "a.exr").metadata == found


@pytest.mark.parametrize(("name", "texts"), [("a.exr", read_metadata), ("a.png", read_texts)])
def test_a_reserved_text_is_set_behind_the_pixels(tmp_path, name, texts):
    types = dict.fromkeys("RGB", "half" if name == "a.exr" else "uint8")
    given = {"illum:first": "x", "illum:later": RESERVED, "illum:last": "y"}
    with ImageWriter(tmp_path / name, 3, 2, types, given) as writer:
        writer.write_band(0, np.ones((2, 3, 3), np.float32 if name == "a.exr" else np.uint8))
        with pytest.raises(ValueError, match="no room"):
            writer.set_text("illum:later", "a" * (len(RESERVED) + 1))
        writer.set_text("illum:later", "0.5 (0.4 to 0.6)")
    found = texts(tmp_path / name)
    assert [found[key].rstrip() for key in given] == ["x", "0.5 (0.4 to 0.6)", "y"]
    assert is_sealed(tmp_path / name)


def test_whole_numbers_beyond_32_bits_become_text(tmp_path):
    write(tmp_path / "a.exr", noise(3, 3, 1), {"Z": "float"}, metadata={"illum:seed": 2**63 + 1})
    assert read_metadata(tmp_path / "a.exr")["illum:seed"] == str(2**63 + 1)


@pytest.mark.parametrize("number", [2**31 - 1, -(2**31), 2**31, -(2**31) - 1])
def test_whole_numbers_of_32_bits_stay_numbers(tmp_path, number):
    write(tmp_path / "a.exr", noise(3, 3, 1), {"Z": "float"}, metadata={"illum:seed": number})
    fits = -(2**31) <= number < 2**31
    assert read_metadata(tmp_path / "a.exr")["illum:seed"] == (number if fits else str(number))


def test_png_metadata_survives_as_text(tmp_path):
    given = {"illum:seed": 7, "illum:exposure": 0.5, "illum:eye": (1, 2), "illum:scene": "teapot"}
    write(tmp_path / "a.png", np.zeros((3, 3, 3), np.uint8), dict.fromkeys("RGB", "uint8"), metadata=given)
    found = read_metadata(tmp_path / "a.png")
    assert [found[name] for name in given] == ["7", "0.5", "1 2", "teapot"]
    assert found["oiio:ColorSpace"] == "srgb_rec709_scene"


def test_files_carry_no_time_of_day(tmp_path):
    write(tmp_path / "a.exr", noise(3, 3, 3), channel_types("RGB"))
    assert "DateTime" not in read_metadata(tmp_path / "a.exr")


# ------------------------------------------------------------------ refusals while writing


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_with_channel_count_and_place(tmp_path, bad):
    pixels = noise(20, 8, len(LAYERED))
    pixels[13, 5, 4] = pixels[14, 0, 4] = pixels[12, 7, 1] = bad
    with pytest.raises(IllumError) as caught:
        write(tmp_path / "a.exr", pixels, channel_types(LAYERED), rows=10)
    assert "channel G: NaN or infinite in 1 pixels, the first at x 7, y 12" in str(caught.value)
    assert "channel Z: NaN or infinite in 2 pixels, the first at x 5, y 13" in str(caught.value)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["a.jpg", "a.tif", "a", "a.exr.bak"])
def test_other_formats_are_refused(tmp_path, name):
    with pytest.raises(InputError, match=r"written as \.exr or \.png"):
        ImageWriter(tmp_path / name, 4, 4, channel_types("RGB"))
    assert os.listdir(tmp_path) == []


def test_bands_out_of_order_or_missing_are_programming_errors(tmp_path):
    with pytest.raises(ValueError, match="at row 4, after 0 rows"):
        write_from(tmp_path, 4, noise(4, 8, 3))
    with pytest.raises(ValueError, match="after 0 rows"):
        write_from(tmp_path, 0, noise(9, 8, 3))
    with pytest.raises(ValueError, match="closed after 4 of 8 rows"):
        write_from(tmp_path, 0, noise(4, 8, 3))
    with pytest.raises(ValueError, match="a band of float64"):
        write_from(tmp_path, 0, noise(8, 8, 3).astype(np.float64))
    assert os.listdir(tmp_path) == []


def write_from(folder, y0, band):
    with ImageWriter(folder / "a.exr", 8, 8, dict.fromkeys("RGB", "float")) as writer:
        writer.write_band(y0, band)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_interrupt_leaves_no_debris(tmp_path, stop):

    def stopped():
        with ImageWriter(tmp_path / "a.exr", 8, 8, channel_types("RGB")) as writer:
            writer.write_band(0, noise(4, 8, 3))
            raise stop

    with pytest.raises(stop):
        stopped()
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_a_picture_that_is_given_up_says_nothing_by_itself(tmp_path, capfd, name):
    ImageWriter(tmp_path / name, 8, 8, {"Y": "uint8" if name == "a.png" else "half"}).discard()
    assert capfd.readouterr().err == ""
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("suffix", [".exr", ".png"])
@pytest.mark.parametrize("damage", ["cut", "last byte", "middle"])
def test_read_back_catches_a_damaged_part(tmp_path, monkeypatch, suffix, damage):
    format_ = exr.ExrFile if suffix == ".exr" else png.PngFile
    compare = format_.is_as_written

    def damaged(self):
        path = self._path
        data = bytearray(path.read_bytes())
        if damage == "cut":
            del data[len(data) // 2 :]
        elif damage == "last byte":
            del data[-1]
        else:
            data[len(data) // 2] ^= 0xFF
        path.write_bytes(data)
        return compare(self)

    monkeypatch.setattr(format_, "is_as_written", damaged)
    pixels, types = noise(60, 40, 3), channel_types("RGB")
    if suffix == ".png":
        pixels, types = (np.abs(pixels) * 60).astype(np.uint8), dict.fromkeys("RGB", "uint8")
    (tmp_path / f"a{suffix}").write_bytes(b"old")
    with pytest.raises(OutputError, match=r"read back.*free space"):
        write(tmp_path / f"a{suffix}", pixels, types)
    assert os.listdir(tmp_path) == [f"a{suffix}"]
    assert (tmp_path / f"a{suffix}").read_bytes() == b"old"


def test_read_back_catches_other_pixels_in_a_sound_file(tmp_path, monkeypatch):
    class Forgetful:
        """Writes black, whatever it is given."""

        def __init__(self, output):
            self.open, self.close, self.geterror = output.open, output.close, output.geterror
            self.write_scanlines = lambda y0, y1, z, band: output.write_scanlines(y0, y1, z, band * 0)

    create = oiio.ImageOutput.create
    monkeypatch.setattr(exr.oiio.ImageOutput, "create", lambda kind: Forgetful(create(kind)))
    with pytest.raises(OutputError, match="differs from what was written"):
        write(tmp_path / "a.exr", noise(8, 8, 3), channel_types("RGB"))
    assert os.listdir(tmp_path) == []


def test_complaint_of_the_library_is_a_failure_whatever_it_returns(tmp_path, monkeypatch):
    create = oiio.ImageOutput.create

    class Complaining:
        def __init__(self, output):
            self.open, self.close, self.write_scanlines = output.open, output.close, output.write_scanlines
            self.geterror = lambda: "short write\n"

    monkeypatch.setattr(exr.oiio.ImageOutput, "create", lambda kind: Complaining(create(kind)))
    with pytest.raises(OutputError, match=r"a\.exr: cannot be written: short write; free space"):
        write(tmp_path / "a.exr", noise(8, 8, 3), channel_types("RGB"))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("message", ["EXR OUT_OF_MEMORY", "std::bad_alloc"])
def test_too_little_memory_in_the_library_is_said_as_such(tmp_path, monkeypatch, message):
    create = oiio.ImageOutput.create

    class Starving:
        def __init__(self, output):
            self.open, self.close, self.geterror = output.open, output.close, lambda: message
            self.write_scanlines = lambda *words: False

    monkeypatch.setattr(exr.oiio.ImageOutput, "create", lambda kind: Starving(create(kind)))
    with pytest.raises(MemoryError):
        write(tmp_path / "a.exr", noise(8, 8, 3), channel_types("RGB"))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(("reason", "error"), [("", MemoryError), ("no plug-in", OutputError)])
def test_a_library_without_the_format_is_said(tmp_path, monkeypatch, reason, error):
    monkeypatch.setattr(exr.oiio.ImageOutput, "create", lambda kind: None)
    monkeypatch.setattr(exr.oiio, "geterror", lambda: reason)
    with pytest.raises(error, match="no plug-in; install one that writes .exr" if reason else None):
        ImageWriter(tmp_path / "a.exr", 4, 4, channel_types("RGB"))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "size", "types"),
    [("a.exr", 4, {"Y": "uint8"}), ("a.png", 4, {"Y": "half"}), ("a.exr", 0, {"Y": "half"})],
)
def test_what_a_format_does_not_hold_is_a_programming_error(tmp_path, name, size, types):
    with pytest.raises(ValueError, match=rf"no {size} x {size} (openexr|png) image"):
        ImageWriter(tmp_path / name, size, size, types)
    assert os.listdir(tmp_path) == []


def test_a_channel_name_that_the_format_cuts_is_an_error_and_no_file(tmp_path):
    with pytest.raises(OutputError, match=r"cannot be read back .*it holds the channels"):
        write(tmp_path / "a.exr", noise(4, 4, 2), {"Z": "float", "x" * 300: "float"})
    assert os.listdir(tmp_path) == []


def test_a_path_that_is_not_utf_8_is_refused_by_name(tmp_path):
    path = os.fsencode(tmp_path) + b"/\xff.exr"
    with pytest.raises(InputError, match=r"\\xff\.exr: the path is not UTF-8"):
        ImageWriter(os.fsdecode(path), 4, 4, channel_types("RGB"))
    with open(path, "wb"), pytest.raises(InputError, match=r"\\xff\.exr: the path is not UTF-8"):
        read_image(os.fsdecode(path))


FULL_DISK = """
    import os, resource, sys
    import numpy as np
    from illumcli.errors import OutputError
    from illumcli.images.writer import ImageWriter

    folder, name = sys.argv[1:]
    pixels, kind = np.random.default_rng(0).random((256, 256, 3)).astype(np.float32), "half"
    if name.endswith(".png"):
        pixels, kind = (pixels * 255).astype(np.uint8), "uint8"

    def attempt(limit):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        with ImageWriter(os.path.join(folder, name), 256, 256, dict.fromkeys("RGB", kind)) as writer:
            for y in range(0, 256, 64):
                writer.write_band(y, pixels[y : y + 64])
        return writer.close().bytes

    size = attempt(1 << 24)
    os.unlink(os.path.join(folder, name))
    for limit in (0, 8, 4096, *range(20_000, size, 20_000), size - 4096, size - 12, size - 1):
        try:
            attempt(limit)
        except OutputError as error:
            assert f"{name}: cannot be written: " in str(error), error
            assert "\\n" not in str(error), error
            assert os.listdir(folder) == [], limit
        else:
            raise AssertionError(f"{limit} of {size} bytes were enough")
    assert attempt(size) == size
"""


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_full_disk_at_any_byte_leaves_nothing(tmp_path, name):
    command = [sys.executable, "-c", textwrap.dedent(FULL_DISK), str(tmp_path), name]
    run = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    assert run.returncode == 0, run.stderr
    assert os.listdir(tmp_path) == [name]


# ------------------------------------------------------------------ reading


@pytest.mark.parametrize("suffix", ["exr", "png", "jpg", "tif", "hdr"])
def test_files_cut_short_are_refused(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    buffer = oiio.ImageBuf(oiio.ImageSpec(64, 48, 3, "float" if suffix in ("exr", "hdr") else "uint8"))
    buffer.set_pixels(oiio.ROI(), np.abs(noise(48, 64, 3)))
    assert buffer.write(str(path))
    assert read_image(path).width == 64
    whole = path.read_bytes()
    for size in (0, 1, 10, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError, match=rf"a\.{suffix}: cannot be read"):
            read_image(path)


def test_a_picture_that_vanishes_while_it_is_opened_is_refused(tmp_path, monkeypatch):
    write(tmp_path / "a.png", np.zeros((4, 4, 1), np.uint8), {"Y": "uint8"})

    def gone(path, tail):
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(reader, "_ends_with", gone)
    with pytest.raises(InputError, match=r"a\.png: cannot be read as an image: No such file"):
        read_image(tmp_path / "a.png")


def test_missing_and_foreign_files_are_refused(tmp_path):
    (tmp_path / "text.exr").write_text("not an image")
    (tmp_path / "text.txt").write_text("not an image")
    with pytest.raises(InputError, match=r"none\.exr: no such file"):
        read_image(tmp_path / "none.exr")
    with pytest.raises(InputError, match="not a file"):
        read_metadata(tmp_path)
    for name in ("text.exr", "text.txt"):
        with pytest.raises(InputError, match=rf"{name}: cannot be read as an image: .*make or fetch"):
            read_image(tmp_path / name)


def test_tiled_and_cropped_images_are_read(tmp_path):
    pixels = np.abs(noise(70, 90, 3))
    spec = oiio.ImageSpec(90, 70, 3, "float")
    spec.tile_width, spec.tile_height = 32, 32
    spec.x, spec.y, spec.full_width, spec.full_height = 5, 7, 200, 100
    output = oiio.ImageOutput.create("openexr")
    assert output.open(str(tmp_path / "a.exr"), spec)
    assert output.write_image(pixels)
    assert output.close()
    image = read_image(tmp_path / "a.exr")
    np.testing.assert_array_equal(image.channels["G"], pixels[..., 1])


def test_exr_of_several_parts_is_refused_with_a_way_out(tmp_path):
    specs = tuple(oiio.ImageSpec(8, 8, 3, "half") for _ in range(2))
    output = oiio.ImageOutput.create("openexr")
    assert output.open(str(tmp_path / "a.exr"), specs)
    assert output.write_image(noise(8, 8, 3))
    assert output.open(str(tmp_path / "a.exr"), specs[1], "AppendSubimage")
    assert output.write_image(noise(8, 8, 3))
    assert output.close()
    with pytest.raises(InputError, match="several parts; join them"):
        read_image(tmp_path / "a.exr")


def test_metadata_is_read_without_pixels(tmp_path):
    write(tmp_path / "a.exr", noise(64, 64, 3), channel_types("RGB"), metadata={"illum:seed": 3})
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[: len(data) // 2])
    assert read_metadata(tmp_path / "a.exr")["illum:seed"] == 3


# ------------------------------------------------------------------ whole numbers


IDS = np.array([[0, 1, 2**24 + 1, 2**24 + 3, 123_456_789, 2**31 - 1, 2**32 - 1]], np.uint32)


@pytest.mark.parametrize("colour", [None, "half", "float"])
def test_whole_numbers_of_32_bits_are_exact(tmp_path, colour):
    """One by one, as other readers see them, and through a second file."""
    types = {"id.Y": "uint"} if colour is None else {"R": colour, "id.Y": "uint", "Z": "float"}
    band = np.full((1, IDS.shape[1], len(types)), 0.5, np.float32)
    band[..., list(types).index("id.Y")] = bits_of(IDS)
    path = tmp_path / "a.exr"
    with ImageWriter(path, IDS.shape[1], 1, types) as writer:
        writer.write_band(0, band)
    found = read_image(path).channels
    assert found["id.Y"].dtype == np.uint32
    np.testing.assert_array_equal(found["id.Y"], IDS)
    for name in types.keys() - {"id.Y"}:
        assert found[name].dtype == np.float32
        assert (found[name] == 0.5).all()
    with_library = oiio.ImageInput.open(str(path))
    spec = with_library.spec()
    c = spec.channelnames.index("id.Y")
    assert spec.channelformat(c) == oiio.UINT
    np.testing.assert_array_equal(
        np.asarray(with_library.read_scanlines(0, 0, 0, 1, 0, c, c + 1, oiio.UINT))[..., 0], IDS
    )


def test_a_texture_of_whole_numbers_has_their_values(tmp_path):
    with ImageWriter(tmp_path / "a.exr", 2, 1, {"Y": "uint"}) as writer:
        writer.write_band(0, bits_of(np.array([[[3], [70000]]], np.uint32)))
    assert linear(tmp_path / "a.exr").ravel().tolist() == [3, 70000]


def test_colour_beside_whole_numbers_must_be_finite(tmp_path):
    band = np.zeros((1, 2, 2), np.float32)
    band[0, 1, 1] = np.nan
    with (
        pytest.raises(IllumError, match="channel Z"),
        ImageWriter(tmp_path / "a.exr", 2, 1, {"id.Y": "uint", "Z": "float"}) as writer,
    ):
        writer.write_band(0, band)


# ------------------------------------------------------------------ textures


def test_srgb_textures_become_linear_and_alpha_stays(tmp_path):
    texels = np.array([[[0, 10, 11, 128], [188, 255, 127, 64]]], np.uint8)
    write(tmp_path / "a.png", texels, dict.fromkeys("RGBA", "uint8"))
    decoded = linear(tmp_path / "a.png", "srgb")
    assert decoded.dtype == np.float32
    expected = [[0, 10 / 255 / 12.92, 0.0033465358], [0.5028864580, 1, 0.2122307573]]
    np.testing.assert_allclose(decoded[0, :, :3], expected, rtol=1e-6)
    np.testing.assert_array_equal(decoded[0, :, 3], np.array([128, 64], np.float32) / np.float32(255))
    np.testing.assert_allclose(linear(tmp_path / "a.png", "linear"), texels / 255, rtol=1e-7)


def test_deep_textures_are_decoded_alike(tmp_path):
    steps = np.arange(256, dtype=np.uint8).reshape(16, 16, 1)
    write(tmp_path / "a.png", steps, {"Y": "uint8"})
    write(tmp_path / "b.png", steps.astype(np.uint16) * 257, {"Y": "uint16"})
    np.testing.assert_allclose(
        linear(tmp_path / "b.png", "srgb"), linear(tmp_path / "a.png", "srgb"), rtol=2e-6
    )


def test_linear_textures_in_single_precision_are_as_they_are(tmp_path):
    texels = np.abs(noise(6, 5, 3))
    write(tmp_path / "a.exr", texels, dict.fromkeys("RGB", "float"))
    np.testing.assert_array_equal(linear(tmp_path / "a.exr", "linear"), texels)


@pytest.mark.parametrize(
    ("name", "kind", "expected"),
    [
        ("a.exr", "half", 0.5),
        ("a.exr", "float", 0.5),
        ("a.hdr", "float", 0.5),
        ("a.tif", "float", 0.5),
        ("a.tif", "uint16", 0.2140411),
        ("a.png", "uint16", 0.2140411),
        ("a.png", "uint8", 0.2158605),  # 128 / 255
    ],
)
def test_the_type_of_its_pixels_says_how_a_texture_codes_light(tmp_path, name, kind, expected):
    buffer = oiio.ImageBuf(oiio.ImageSpec(4, 4, 3, kind))
    buffer.set_pixels(oiio.ROI(), np.full((4, 4, 3), 0.5, np.float32))
    assert buffer.write(str(tmp_path / name))
    np.testing.assert_allclose(linear(tmp_path / name), expected, rtol=1e-4)
    other = {0.5: ("srgb", 0.2140411)}.get(expected, ("linear", 0.5))
    np.testing.assert_allclose(linear(tmp_path / name, other[0]), other[1], rtol=5e-3)


def test_textures_that_are_not_finite_are_refused(tmp_path):
    texels = noise(4, 4, 3)
    texels[1, 1, 0] = np.nan
    buffer = oiio.ImageBuf(oiio.ImageSpec(4, 4, 3, "float"))
    buffer.set_pixels(oiio.ROI(), texels)
    assert buffer.write(str(tmp_path / "a.exr"))
    with pytest.raises(InputError, match="1 texels are NaN or infinite"):
        linear(tmp_path / "a.exr", "linear")


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
def test_textures_of_integers_stay_so_in_memory(tmp_path, kind):
    texels = np.arange(24, dtype=kind).reshape(2, 4, 3)
    texels[0, 0] = np.iinfo(kind).max
    write(tmp_path / "a.png", texels, dict.fromkeys("RGB", kind))
    assert (read_texture(tmp_path / "a.png").stored == texels).all()
    assert read_texture(tmp_path / "a.png").stored.dtype == kind
    assert texture_bytes(tmp_path / "a.png") == texels.nbytes
    np.testing.assert_allclose(linear(tmp_path / "a.png", "linear"), texels / np.iinfo(kind).max, rtol=1e-7)
    write(tmp_path / "a.exr", texels.astype(np.float32), dict.fromkeys("RGB", "float"))
    assert texture_bytes(tmp_path / "a.exr") == 4 * texels.size


@pytest.mark.parametrize("as_integers", [True, False])
def test_channels_of_textures_are_selected_and_clipped(as_integers):
    table = np.linspace(0, 2, 256, dtype=np.float32)
    numbers = np.random.default_rng(1).integers(0, 256, (5, 4, 4), dtype=np.uint8)
    tables = np.stack([table, table * 2, table, table * 3])
    values = np.stack([tables[c][numbers[..., c]] for c in range(4)], axis=-1)
    whole = Texels(numbers, (0, 1, 2, 3), tables) if as_integers else Texels(values, (0, 1, 2, 3))
    image, outside = whole.select((3, 1, 1)).clipped(0.5, 1.5)
    expected = values[..., [3, 1, 1]]
    assert outside == np.count_nonzero((expected < 0.5) | (expected > 1.5))
    index = np.array([3, 19, 0])
    np.testing.assert_array_equal(image.at(index), np.clip(expected, 0.5, 1.5).reshape(-1, 3)[index])
