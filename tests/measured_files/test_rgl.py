"""RGL files: what is read, what is refused with which words, and changed bytes."""

from __future__ import annotations

import random
import struct
import tracemalloc

import numpy as np
import pytest

import rgl_files
from illumcli.errors import InputError
from illumcli.measured_files import rgl, tensor_file


@pytest.fixture
def path(tmp_path):
    return tmp_path / "synthetic.bsdf"


def refused(path, content, *facts):
    """Assert that a file is refused with its name and these facts."""
    path.write_bytes(content if isinstance(content, bytes) else rgl_files.tensor_file(content))
    with pytest.raises(InputError) as caught:
        rgl.read(str(path))
    for fact in (str(path), *facts):
        assert fact in str(caught.value)


def with_type(values, dtype):
    return np.asarray(values).astype(dtype)


def changed(values, at, value):
    out = np.array(values)
    out[at] = value
    return out


def test_a_measurement_is_read(path):
    fields = rgl_files.noise()
    path.write_bytes(rgl_files.tensor_file(fields))
    found = rgl.read(str(path))
    np.testing.assert_array_equal(found.theta, fields["theta_i"])
    np.testing.assert_array_equal(found.ndf, fields["ndf"][0])
    np.testing.assert_array_equal(found.sigma, fields["sigma"][0])
    np.testing.assert_array_equal(found.vndf, fields["vndf"][0])
    np.testing.assert_array_equal(found.rgb, fields["rgb"][0])
    assert found.is_divided


def test_all_types_of_the_container_are_read(path):
    fields = {
        dtype: np.arange(6).reshape(2, 3).astype(dtype) for dtype in ("u1", "u2", "u4", "f2", "f4", "f8")
    }
    path.write_bytes(rgl_files.tensor_file(fields))
    found = tensor_file.fields(str(path))
    for dtype, values in fields.items():
        np.testing.assert_array_equal(tensor_file.load(str(path), found[dtype]), values)


@pytest.mark.parametrize(
    ("content", "facts"),
    [
        (b"", ("does not begin with tensor_file", "name a .bsdf file")),
        (b"\x89PNG" * 30, ("does not begin with tensor_file",)),
        (b"tensor_file\0\1\0", ("ends within its header", "fetch it again")),
        (b"tensor_file\0\2\0" + bytes(40), ("version 2.0", "1.0 is read")),
        (b"tensor_file\0\1\0" + b"\xff" * 40, ("claims to have 4294967295 fields",)),
        (b"tensor_file\0\1\0\1\0\0\0\xff\xffrgb", ("ends within its header",)),
        (b"tensor_file\0\1\0\1\0\0\0\1\0x\1\0\0" + bytes(16), ("'x' has the unknown type 0",)),
        (b"tensor_file\0\1\0\1\0\0\0\1\0x\1\0\12" + struct.pack("<QQ", 40, 1 << 60), ("'x' ends beyond",)),
    ],
)
def test_what_is_no_whole_tensor_file_is_refused(path, content, facts):
    refused(path, content, *facts)


def test_a_truncated_file_is_refused(path):
    content = rgl_files.tensor_file(rgl_files.noise())
    for length in (0, 11, 17, 100, 300, len(content) // 2, len(content) - 16):
        refused(path, content[:length])


def test_measurements_of_other_kinds_are_refused_by_name(path):
    fields = rgl_files.noise()
    refused(path, {**fields, "phi_i": np.zeros(16, np.float32)}, "anisotropic", "16 azimuths", "isotropic")
    spectral = {name: values for name, values in fields.items() if name != "rgb"}
    refused(path, {**spectral, "spectra": fields["rgb"]}, "spectral", "_rgb.bsdf")
    refused(path, spectral, "has no field 'rgb'", "_rgb.bsdf")


@pytest.mark.parametrize(
    ("name", "change", "fact"),
    [
        ("ndf", lambda x: with_type(x, np.float64), "must be of type f4, is of f8"),
        ("jacobian", lambda x: with_type(x, np.float32), "must be of type u1, is of f4"),
        ("vndf", lambda x: x[:, :5], "must have the shape (1, 8, any, any), has (1, 5, 9, 12)"),
        ("vndf", lambda x: x[..., :1], "has (1, 8, 9, 1)"),
        ("rgb", lambda x: x[:, :, :1], "must have the shape (1, 8, 3, any, any)"),
        ("rgb", lambda x: x[0], "has (8, 3, 6, 5)"),
        ("ndf", lambda x: x[:, :0], "has (2, 0)"),
        ("theta_i", lambda x: x[None], "must have the shape (1), has (1, 8)"),
        ("theta_i", lambda x: x[::-1], "must ascend"),
        ("theta_i", lambda x: x * 90, "must ascend from 0 to pi/2"),
        ("rgb", lambda x: changed(x, (0, 3, 1, 2, 2), np.nan), "not finite"),
        ("vndf", lambda x: changed(x, (0, 3, 1, 2), np.inf), "not finite"),
        ("sigma", lambda x: x * 0, "'sigma' must be above 0"),
        ("ndf", lambda x: -x, "'ndf' must not be negative"),
        ("vndf", lambda x: changed(x, (0, 2), 0), "'vndf' must be a density"),
        ("vndf", lambda x: changed(x, (0, 2, 2, 2), -1), "'vndf' must be a density"),
        ("rgb", lambda x: x * np.float32(1e32), "which no surface reflects"),
        ("sigma", lambda x: changed(x, (1, 2), 5), "'sigma' varies with the azimuth"),
    ],
)
def test_faulty_fields_are_refused(path, name, change, fact):
    fields = rgl_files.noise()
    refused(path, {**fields, name: change(fields[name])}, f"'{name}'", fact)


def test_large_fields_are_refused_before_they_are_loaded(path):
    fields = rgl_files.noise()
    content = bytearray(rgl_files.tensor_file(fields))
    at = content.index(b"vndf") + 4 + 3 + 8 + 16  # the sizes after the first two
    content[at : at + 16] = struct.pack("<QQ", 1 << 16, 1 << 12)
    with path.open("wb") as file:  # a sparse file
        file.write(content)
        file.truncate(1 << 34)
    tracemalloc.start()
    with pytest.raises(InputError, match="more than 16,777,216 values"):
        rgl.read(str(path))
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


@pytest.mark.parametrize("count", [300, pytest.param(30_000, marks=pytest.mark.slow)])
def test_changed_bytes_are_read_or_refused(path, count):
    chance = random.Random(count)
    fields = rgl_files.noise()
    whole = rgl_files.tensor_file(fields)
    header = whole.index(b"synthetic")
    outcomes = {"read": 0, "refused": 0}
    tracemalloc.start()
    for _ in range(count):
        content = bytearray(whole)
        for _ in range(chance.choice([1, 1, 1, 2, 8])):
            at = chance.randrange(header if chance.random() < 0.8 else len(content))
            kind = chance.randrange(4)
            if kind == 0:
                content[at] = chance.choice([0, 1, 2, 127, 128, 255])
            elif kind == 1:
                content[at] ^= 1 << chance.randrange(8)
            elif kind == 2:
                del content[at : at + chance.choice([1, 2, 8, 1000])]
            else:
                content[at:at] = chance.randbytes(chance.choice([1, 2, 8]))
        path.write_bytes(content)
        try:
            found = rgl.read(str(path))
        except InputError as error:
            said = str(error)
            outcomes["refused"] += 1
        else:
            assert all(np.isfinite(each).all() for each in found)
            said = f"{path}; read"
            outcomes["read"] += 1
        assert said.startswith(str(path))
        assert ";" in said  # a fact; a way out
    assert tracemalloc.get_traced_memory()[1] < 1 << 24
    tracemalloc.stop()
    assert min(outcomes.values()) > count / 50, outcomes
