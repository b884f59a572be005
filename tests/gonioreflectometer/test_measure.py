"""`illum measure`: files, kept and resumed runs, surfaces of every kind, refusals."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from click.testing import CliRunner

from illumcli.cli import illum as command
from illumcli.errors import InputError
from illumcli.gonioreflectometer import bench, rows
from illumcli.gonioreflectometer.bench import Bench
from illumcli.gonioreflectometer.rows import Instrument, row_count
from illumcli.gonioreflectometer.settings import MeasureSettings, SurfaceSource
from illumcli.gonioreflectometer.sources import read_surface
from illumcli.gonioreflectometer.table import is_done, read_table, table_contents
from illumcli.measured_files import merl
from illumcli.models.merl import Merl
from illumcli.progress import no_progress
from illumcli.shading.terms import evaluate

COARSE = ("--samples", "8", "--facets", "lambert", "--anisotropic", "--step", "30")
BUMPS = "0.05*cos(2*pi*x)"


def run(*words):
    """The command here; its exit code and all that it says."""
    done = CliRunner().invoke(command, ["measure", *map(str, words)])
    assert (
        done.exception is None
        or isinstance(done.exception, SystemExit)
        or hasattr(done.exception, "exit_code")
    )
    code = getattr(done.exception, "exit_code", done.exit_code)
    return code, done.output + (str(done.exception) if done.exception else "")


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A MERL table of a slightly rough mirror of copper."""
    path = tmp_path_factory.mktemp("measured") / "bumps.binary"
    code, _ = run("0.005*cos(2*pi*x)", "-o", path, "--samples", 8, "--fresnel", "copper", "--grid", 64, "-q")
    assert code == 0
    return path


def test_a_merl_table_is_read_by_the_model_and_by_its_reader(measured):
    values, table = merl.read(measured), read_table(measured.with_suffix(".npz"))
    np.testing.assert_array_equal(np.isnan(values), np.isnan(table.brdf))
    np.testing.assert_allclose(values[~np.isnan(values)], table.brdf[~np.isnan(table.brdf)], rtol=1e-6)
    assert (table.standard_error[table.brdf > 0] > 0).all()
    assert np.nanmax(values[:, 20:]) == 0  # no facet is steeper than 1.8 degrees
    row = values[:, 5].reshape(3, -1)
    l, v = merl.cell_directions(5)
    high = (l[:, 2] > 0.5) & (v[:, 2] > 0.5)
    assert (row[:, high] > 0).all()
    np.testing.assert_allclose(row[1, high][0] / row[0, high][0], 0.64 / 0.95, rtol=1e-4)

    # The model's nearest cell of a cell's own directions.
    cell = int(np.flatnonzero(high)[7])
    model = Merl(file=str(measured), lookup="nearest")
    given = {"n": np.array([[0, 0, 1.0]]), "l": l[cell : cell + 1], "v": v[cell : cell + 1]}
    (lobe,) = evaluate(model.lobes(), given).values()
    np.testing.assert_allclose(lobe[0] / l[cell, 2], row[:, cell], rtol=1e-6)


def test_an_equal_table_is_kept_and_another_refused(tmp_path):
    out = tmp_path / "a.npz"
    words = [BUMPS, "-o", out, *COARSE]
    assert run(*words)[0] == 0
    before = out.stat().st_ino
    code, text = run(*words)
    assert code == 0
    assert "kept" in text
    code, text = run(*words, "--albedo", "0.5")
    assert code == 5
    assert "--force" in text
    assert run(*words, "--albedo", "0.5", "--force")[0] == 0
    assert out.stat().st_ino != before


def test_a_binary_that_was_changed_is_not_kept(tmp_path, measured):
    copy = tmp_path / "b.binary"
    copy.write_bytes(measured.read_bytes()[:-8] + bytes(8))
    copy.with_suffix(".npz").write_bytes(measured.with_suffix(".npz").read_bytes())
    content = table_contents(copy.with_suffix(".npz"))[0]
    files = copy, copy.with_suffix(".npz")
    assert not is_done(files, content, force=False)
    copy.write_bytes(measured.read_bytes())
    assert is_done(files, content, force=False)


def test_an_interrupted_run_goes_on(tmp_path, monkeypatch):
    out, done = tmp_path / "c.npz", []
    true_row = Instrument.row

    def row(self, number, *more):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(number)
        return true_row(self, number, *more)

    with monkeypatch.context() as patch:
        patch.setattr(rows.Instrument, "row", row)
        assert CliRunner().invoke(command, ["measure", BUMPS, "-o", str(out), *COARSE]).exit_code != 0
    assert not out.exists()
    again = []
    monkeypatch.setattr(rows.Instrument, "row", lambda self, n, *m: again.append(n) or true_row(self, n, *m))
    code, text = run(BUMPS, "-o", out, *COARSE)
    assert code == 0
    assert "2 of 3 rows were measured before" in text
    assert again == [2]
    assert run(BUMPS, "-o", tmp_path / "d.npz", *COARSE)[0] == 0
    for name in ("brdf", "standard_error"):
        np.testing.assert_array_equal(
            getattr(read_table(out), name), getattr(read_table(tmp_path / "d.npz"), name)
        )
    assert not list(tmp_path.glob(".*"))


def test_workers_of_a_cluster_measure_the_same(illum, tmp_path):
    pytest.importorskip("distributed")
    for name, more in (("one", ()), ("two", ("--cluster", "local:2"))):
        done = illum("measure", BUMPS, "-o", f"{name}.npz", *COARSE, "-q", *more)
        assert done.returncode == 0, done.stderr
    one, two = (read_table(tmp_path / f"{name}.npz") for name in ("one", "two"))
    np.testing.assert_array_equal(one.brdf, two.brdf)
    np.testing.assert_array_equal(one.standard_error, two.standard_error)


def test_a_picture_is_the_formula_that_it_shows(tmp_path):
    """Rows of a picture go down and y up."""
    x, y = np.meshgrid(np.arange(16) / 16, np.arange(8) / 8)
    z = 0.5 + 0.3 * np.cos(2 * np.pi * x) + 0.2 * np.sin(4 * np.pi * y)
    path = tmp_path / "heights.png"
    path.write_bytes(png16(np.rint(z[::-1] * 65535).astype(np.uint16)))
    of_picture, _ = read_surface(SurfaceSource(str(path), height=0.2))
    formula = "0.06*cos(2*pi*x) + 0.04*sin(8*pi*y)"
    of_formula, _ = read_surface(SurfaceSource(formula, period=(1.0, 0.5), grid=16))
    np.testing.assert_allclose(of_picture.vertices, of_formula.vertices, atol=1e-5)
    with pytest.raises(InputError, match="--height must be a finite number, is nan"):
        read_surface(SurfaceSource(str(path), height=float("nan")))


def png16(z):
    """The bytes of a grey PNG of 16 bits."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows_ = b"".join(b"\0" + row.astype(">u2").tobytes() for row in z)
    head = struct.pack(">IIBBBBB", z.shape[1], z.shape[0], 16, 0, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows_)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


@pytest.mark.parametrize(
    ("words", "fact"),
    [
        (("x", "-o", "a.npz"), "differs by 1 between x = 0 and x = 1"),
        (("log(x - 0.5)", "-o", "a.npz"), "is no number at x = 0"),
        (("q + 1", "-o", "a.npz"), "unknown name 'q'"),
        (("0*x", "-o", "a.txt"), ".binary or .npz"),
        (("0*x", "-o", "a.binary", "--anisotropic"), "let the name end so"),
        (("0*x", "-o", "a.npz", "--step", "10"), "--anisotropic"),
        (("0*x", "-o", "a.npz", "--anisotropic", "--step", "7"), "does not divide"),
        (("0*x", "-o", "a.npz", "--albedo", "0.5"), "--facets lambert"),
        (("0*x", "-o", "a.npz", "--facets", "lambert", "--albedo", "2"), "from 0 to 1"),
        (("0*x", "-o", "a.npz", "--facets", "lambert", "--fresnel", "1.5"), "--albedo"),
        (("0*x", "-o", "a.npz", "--fresnel", "brass"), "copper"),
        (("0*x", "-o", "a.npz", "--samples", "8", "--target-error", "0.1"), "exclude"),
        (("0*x", "-o", "a.npz", "--height", "1"), "pictures"),
        (("none.png", "-o", "a.npz"), "none.png"),
        (("none.png", "-o", "a.npz", "--height", "1"), "no such file"),
        (("none.obj", "-o", "a.npz"), "none.obj"),
    ],
)
def test_refusals_name_the_way_out(words, fact, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, text = run(*words)
    assert code == 2
    assert fact in text
    assert not list(tmp_path.iterdir())


def obj(path, vertices, faces):
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    path.write_text("\n".join(lines + [f"f {' '.join(str(i + 1) for i in face)}" for face in faces]))
    return path


def test_a_tile_that_does_not_cover_its_plane_is_refused(tmp_path):
    path = obj(tmp_path / "half.obj", [(0, 0, 0), (0.5, 0, 0), (0.5, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    code, text = run(path, "-o", tmp_path / "a.npz", "--period", 1)
    assert code == 2
    assert "covers 0.5 times its tile" in text


def table_over_a_plane(tmp_path, height):
    """A square plate of side 1 over a tile of side 2."""
    plane = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
    plate = [(x, y, height) for x, y in ((0.5, 0.5), (1.5, 0.5), (1.5, 1.5), (0.5, 1.5))]
    return obj(tmp_path / "plate.obj", plane + plate, [(0, 1, 2, 3), (4, 5, 6, 7), (4, 7, 6, 5)])


def test_overhangs_are_measured(tmp_path):
    """Light and eye above each other: every lit point is seen, whatever floats; f_r = rho / pi."""
    surface, _ = read_surface(SurfaceSource(str(table_over_a_plane(tmp_path, 0.3)), period=(2.0, 2.0)))
    assert abs(surface.area_vectors[:, 2].sum() - 4) < 1e-12
    measured = Instrument(surface, MeasureSettings(facets="lambert", samples=64, albedo=(1.0,) * 3))
    row = measured.row(0, 2, no_progress)
    l, v = merl.cell_directions(0)
    retro = np.flatnonzero(np.sum(l * v, axis=1) > 0.9995)
    np.testing.assert_allclose(row.values[0, retro], 1 / np.pi, rtol=0.05)
    apart = np.flatnonzero((np.abs(np.sum(l * v, axis=1)) < 0.1) & (l[:, 2] > 0.5) & (v[:, 2] > 0.5))
    assert (row.values[0, apart] < 0.98 / np.pi).all()  # shadows of the plate


@pytest.mark.parametrize("up", ["x", "y", "-z"])
def test_the_axis_that_points_up_is_given(tmp_path, up):
    square = np.array([(0, 0, 0.1), (1, 0, 0), (1, 1, 0.1), (0, 1, 0)], float)
    turned = {"x": square[:, [2, 0, 1]], "y": square[:, [1, 2, 0]], "-z": square * [1, -1, -1]}[up]
    path = obj(tmp_path / "s.obj", turned, [(0, 1, 2), (0, 2, 3)])
    surface, warnings = read_surface(SurfaceSource(str(path), up=up))
    np.testing.assert_allclose(surface.normals[:, 2] > 0.9, True)
    np.testing.assert_allclose(surface.size, 0.5)
    assert "a single piece, footprint 0.5 x 0.5" in warnings[0]


def test_rays_that_leave_a_tile_sideways_meet_its_copies(monkeypatch):
    """Deep grooves at 1 to 4 degrees, with few copies around the tile: as over one of eight periods."""
    monkeypatch.setattr(bench, "MARGINS", (0.05, 0.05))
    formula = "0.5*abs(mod(x, 1) - 0.5)"
    one, eight = (
        Bench(read_surface(SurfaceSource(formula, period=(width, width), grid=64))[0]) for width in (1.0, 8.0)
    )
    random = np.random.default_rng(0)
    low = np.radians(random.uniform(1, 4, 500))
    turn = random.uniform(0, 2 * np.pi, 500)
    d = np.stack([np.cos(low) * np.cos(turn), np.cos(low) * np.sin(turn), np.sin(low)], axis=1)
    u = random.random((500, 2))
    near, far = one.first_points(d, u), eight.first_points(d, u / 8)
    assert near.is_hit.all()
    np.testing.assert_allclose(near.position[:, 2] * 1, far.position[:, 2] * 8, atol=1e-4)


def test_rays_exactly_along_the_sides_of_a_tile():
    waves = Bench(read_surface(SurfaceSource("0.1*cos(2*pi*x)", grid=16))[0])
    d = np.array([[0, 0, 1.0], [0.6, 0, 0.8], [0, -0.6, 0.8], [-0.6, 0, 0.8]])
    hits = waves.first_points(d, np.full((4, 2), 0.3))
    assert hits.is_hit.all()
    assert not waves.occluded(hits, d).any()


def test_more_bounces_take_more_rows_for_mirrors_alone():
    assert row_count(MeasureSettings(bounces=3)) == 98
    assert row_count(MeasureSettings(bounces=3, facets="lambert")) == 90
    assert row_count(MeasureSettings(isotropic=False, step=15.0)) == 6
