"""Views of BRDFs: their numbers against closed forms, their options, their files."""

from __future__ import annotations

import csv
import re
import sys

import numpy as np
import pytest

from illumcli.brdf import DEFAULT_VIEWS, VIEWS, Plot, described, draw_brdfs, write_merl
from illumcli.brdf.albedo import albedo
from illumcli.brdf.curves import panels
from illumcli.brdf.style import style
from illumcli.brdf.views import across_slice, lit_plane, lit_sphere, lobe, polar_slice, slice_angles
from illumcli.cli.brdf import brdf
from illumcli.errors import IllumError, InputError, OutputError
from illumcli.images.reader import read_image
from illumcli.schema.families import members


def only(name, *overrides):
    (model,) = described([name], overrides).values()
    return model


def test_a_slice_of_lambert_is_its_albedo_over_pi():
    model = only("lambert", "diffuse=[0.2, 0.4, 0.6]")
    for times_cos, scale in ((False, 1), (True, np.cos(np.radians(50)))):
        angles, found = polar_slice(model, 50, times_cos)
        np.testing.assert_allclose(
            found, np.tile(np.array([0.2, 0.4, 0.6]) / np.pi * scale, (len(angles), 1))
        )
    assert angles[0] == pytest.approx(-90, abs=0.3)
    assert angles[-1] == pytest.approx(90, abs=0.3)


def test_a_slice_finds_the_narrowest_highlight_at_the_mirror_direction():
    angles, found = polar_slice(
        only("phong", "exponent=1e6", "normalised=true", "diffuse=0", "specular=1"), 40
    )
    at = np.argmax(found[:, 0])
    assert angles[at] == 40
    assert found[at, 0] == pytest.approx((1e6 + 2) / (2 * np.pi), rel=1e-9)
    assert np.count_nonzero(found[:, 0] > found[at, 0] / 2) > 10  # a shape, not a spike


def test_the_light_stands_at_negative_angles():
    angles, found = polar_slice(only("oren_nayar", "sigma=0.6"), 60)  # brighter towards the light
    assert found[np.searchsorted(angles, -60), 0] > 1.3 * found[np.searchsorted(angles, 60), 0]


def test_a_lobe_covers_the_hemisphere_and_holds_the_slice():
    model = only("ward", "form=duer")
    way, found = lobe(model, 40)
    np.testing.assert_allclose(np.linalg.norm(way, axis=-1), 1)
    assert way[..., 2].min() > 0
    assert way[-1, :, 2].max() < 1e-5  # ends at the horizon all round
    angles, slices = polar_slice(model, 40)
    np.testing.assert_allclose(found[0, 0], slices[np.searchsorted(angles, 40)])


def test_a_lit_sphere_shows_lambert_as_white_as_its_albedo():
    ball = lit_sphere(only("lambert", "diffuse=0.5"), 128)
    assert ball.shape == (128, 128, 4)
    assert ball[..., 3].mean() == pytest.approx(np.pi / 4 * 0.98**2, abs=2e-3)
    assert ball[..., 0].max() == pytest.approx(0.5, rel=1e-3)
    y, x = np.unravel_index(np.argmax(ball[..., 0]), ball.shape[:2])
    assert x < 64 > y  # the light comes from the upper left


def test_a_ward_highlight_lies_across_the_grain():
    def shape(picture):
        y, x = np.nonzero(picture[..., 0] > picture[..., 0].max() / 2)
        return np.ptp(x), np.ptp(y)

    wide, tall = shape(lit_sphere(only("ward", "diffuse=0", "alpha_x=0.05", "alpha_y=0.3")))
    assert tall > 2 * wide
    wide, tall = shape(lit_sphere(only("ward", "diffuse=0", "alpha_x=0.3", "alpha_y=0.05")))
    assert wide > 2 * tall


def test_a_lit_plane_mirrors_its_lamp_in_the_middle():
    floor = lit_plane(only("phong", "diffuse=0", "specular=1", "exponent=50"), 96)
    assert floor.shape == (48, 96, 4)
    np.testing.assert_allclose(floor[:, 30:66], floor[:, 65:29:-1], atol=1e-12)
    assert 46 <= np.argmax(floor[..., 0].sum(axis=0)) <= 49


@pytest.mark.parametrize(
    "name",
    [
        Model.model_fields["model"].default
        for Model in members("illumcli.models")
        if not any(each.is_required() for each in Model.model_fields.values())
    ],
)
def test_every_model_has_finite_views(name):
    model = only(name)
    for angle in (0, 45, 89.9):
        assert np.isfinite(polar_slice(model, angle)[1]).all()
    assert np.isfinite(lobe(model, 30, steps=20)[1]).all()
    assert np.isfinite(lit_sphere(model, 32)).all()
    assert np.isfinite(lit_plane(model, 32)).all()


def test_a_slice_across_meets_the_other_in_the_mirror_direction():
    model = only("ward", "alpha_x=0.1", "alpha_y=0.3")
    angles, found = across_slice(model, 40)
    at_mirror = polar_slice(model, 40)[1][polar_slice(model, 40)[0] == 40]
    np.testing.assert_allclose(found[angles == 0], at_mirror, rtol=1e-12)
    np.testing.assert_allclose(found, found[::-1], rtol=1e-9)

    def width(angles, values):
        return np.ptp(angles[values[:, 0] > values[:, 0].max() / 2])

    narrow = across_slice(only("ward", "diffuse=0", "alpha_x=0.3", "alpha_y=0.1"), 0)
    assert width(*across_slice(only("ward", "diffuse=0", "alpha_x=0.1", "alpha_y=0.3"), 0)) > 2 * width(
        *narrow
    )


@pytest.mark.parametrize("incidence", [0, 50, 89])
def test_the_albedo_of_lambert_is_its_parameter(incidence):
    found, error = albedo(only("lambert", "diffuse=[0.2, 0.4, 0.6]"), incidence)
    assert error < 1e-3
    np.testing.assert_allclose(found, [0.2, 0.4, 0.6], rtol=1e-3)


@pytest.mark.parametrize("exponent", [1, 100, 1e6])
def test_the_albedo_of_wide_and_narrow_lobes_is_their_closed_form(exponent):
    lobe = only("phong", f"exponent={exponent}", "normalised=true", "diffuse=0", "specular=1")
    found, error = albedo(lobe, 0)
    assert error < 1e-3
    np.testing.assert_allclose(found, 1, rtol=1e-3)  # (n + 2) / (2 pi) times the integral of cos^(n + 1)


def test_what_the_albedo_misses_is_said(monkeypatch):
    monkeypatch.setattr(sys.modules[albedo.__module__], "ANGLES", (40.0,))
    # a narrow lobe towards the light, away from the directions that are dense
    retro = only("lafortune", "diffuse=0", "specular=1", "exponent=1e5", "cx=1", "cy=1", "cz=1")
    (panel,) = panels("albedo", [("retro", retro)], Plot())
    assert panel.note.startswith("albedo to")


# --- what is asked for ---------------------------------------------------------------------------------


def test_parameters_are_meant_for_all_for_one_by_name_or_by_number():
    models = described(
        ["oren_nayar", "lambert", "oren_nayar"],
        ["diffuse=0.1", "lambert.diffuse=0.2", "3.sigma=0.7", "oren_nayar.form=qualitative"],
    )
    assert list(models) == ["oren_nayar 1", "lambert", "oren_nayar 3"]
    first, second, third = models.values()
    assert (first.diffuse, first.sigma, first.form) == ((0.1,) * 3, 0.3, "qualitative")
    assert second.diffuse == (0.2,) * 3
    assert third.sigma == 0.7


def test_parts_of_parameters_are_reached():
    model = only("cook_torrance", "distribution.D=ggx", "distribution.alpha=0.1")
    assert model.distribution.alpha == 0.1


def test_every_fault_is_said_at_once():
    with pytest.raises(InputError) as caught:
        described(["lambrt", "oren_nayar"], ["oren_nayar.sigma=9", "oren_nayar.sgma=1", "sigam=0.1"])
    assert caught.value.problems == (
        "no model 'lambrt'; did you mean 'lambert'?",
        "-D oren_nayar.sigma=9: must be at most 1.5708, is 9",
        "-D oren_nayar.sgma=1: unknown key 'sgma'; did you mean 'sigma'?",
        "-D sigam=0.1: no model or parameter 'sigam'; did you mean 'sigma'?",
    )


def test_what_a_model_needs_is_said():
    with pytest.raises(InputError, match="merl: missing key 'file'"):
        described(["merl"])


# --- files ---------------------------------------------------------------------------------------------


def test_the_table_holds_the_slices_to_the_last_digit(tmp_path):
    path = tmp_path / "slices.csv"
    assert draw_brdfs(["lambert", "phong"], table=path, plot=Plot(angles=(20.0, 60.0))) == ([path], [], [])
    with path.open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["model", "incidence", "view", "f.R", "f.G", "f.B"]
    assert len(rows) == 1 + 2 * (len(slice_angles(20)) + len(slice_angles(60)))
    mine = np.array([row[3:] for row in rows if row[:2] == ["phong", "60"]], float)
    np.testing.assert_array_equal(mine, polar_slice(only("phong"), 60)[1])


def test_pictures_have_a_column_per_model_and_are_the_same_twice(tmp_path):
    one, again, two = (tmp_path / f"{name}.png" for name in ("one", "again", "two"))
    for path in (one, again):
        draw_brdfs(["phong"], output=path, plot=Plot(("polar", "sphere", "plane")))
    draw_brdfs(["phong", "ward"], output=two, plot=Plot(("polar",), log=True))
    assert one.read_bytes() == again.read_bytes()
    assert read_image(two).width == 2 * read_image(one).width
    assert min(read_image(path).channels["G"].std() for path in (one, two)) > 0.05


def test_an_svg_holds_every_view(tmp_path):
    path = tmp_path / "all.svg"
    draw_brdfs(["blinn_phong"], output=path, plot=Plot(VIEWS))
    text = path.read_text()
    assert text.startswith("<?xml")
    assert text.count("<image") == 2  # sphere and plane
    first = path.read_bytes()
    assert draw_brdfs(["blinn_phong"], output=path, plot=Plot(VIEWS)) == ([path], [path], [])
    assert path.read_bytes() == first


def test_black_models_are_drawn_too(tmp_path):
    draw_brdfs(["lambert"], ["diffuse=0"], tmp_path / "black.png", plot=Plot(("polar", "lobe")))


def test_no_other_file_is_replaced_unasked(tmp_path):
    path = tmp_path / "slices.csv"
    path.write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        draw_brdfs(["lambert"], table=path)
    assert path.read_text() == "mine"
    draw_brdfs(["lambert"], table=path, force=True)
    assert path.read_text().startswith("model,")


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"is written as \.png or \.svg or \.pdf"):
        draw_brdfs(["lambert"], output=tmp_path / "x.gif")


def test_without_matplotlib_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(IllumError, match=r"pip install 'illumcli\[plot\]'"):
        draw_brdfs(["lambert"], output=tmp_path / "x.png", table=tmp_path / "x.csv")
    assert list(tmp_path.iterdir()) == []
    draw_brdfs(["lambert"], table=tmp_path / "x.csv")


def test_values_that_are_drawn_as_0_are_told(illum, tmp_path):
    faulty = ["formula", "lambert", "-D", "formula.response=n_l - n_v"]
    for output in ("--csv=x.csv", "-ox.svg"):
        done = illum("brdf", *faulty, "--view", "polar", "--angle", "60", output)
        assert re.fullmatch(
            r"formula: \d+ values were negative or not finite, and are 0; see illum verify .*\n", done.stderr
        )
    # At 60 degrees n_v is the greater one from -60 to 60 degrees: as many angles, times R, G and B.
    angles = slice_angles(60)
    negative = 3 * np.count_nonzero(np.cos(np.radians(angles)) > np.cos(np.radians(60)))
    assert abs(int(done.stderr.split()[1]) - negative) <= 6
    assert "and are 0" in write_merl(["formula"], ["response=n_l - n_v"], tmp_path / "x.binary")[1][-1]


def test_the_command_prints_its_files_and_needs_no_pyplot(illum, tmp_path):
    done = illum("brdf", "lambert", "phong", "-D", "phong.exponent=9", "--view", "polar", "--csv", "x.csv")
    assert done.stdout == "x.csv\n", done.stderr
    done = illum("brdf", "lambert", "--view", "sphere")
    assert done.stdout == "brdf.png\n", done.stderr
    assert (tmp_path / "brdf.png").read_bytes().startswith(b"\x89PNG")
    assert "matplotlib.pyplot" not in sys.modules  # drawn in this process by the tests above


# --- figures ------------------------------------------------------------------------------------------------


COPPER = ["diffuse=[0.9, 0.5, 0.1]"]


def test_an_overlay_has_one_axis_and_a_curve_for_each_model_and_light():
    models = list(described(["lambert", "oren_nayar"]).items())
    (one,) = panels("cartesian", models, Plot(overlay=True, angles=(10.0, 50.0)))
    assert [curve.name for curve in one.curves] == ["lambert"] * 2 + ["oren_nayar"] * 2
    assert len({curve.style for curve in one.curves}) == 2
    apart = panels("cartesian", models, Plot(angles=(10.0, 50.0)))
    assert [[curve.incidence for curve in each.curves] for each in apart] == [[10, 50], [10, 50]]
    assert len({curve.style for curve in apart[0].curves}) == 2


def test_channels_have_curves_of_their_own():
    models = list(described(["lambert"], COPPER).items())
    (panel,) = panels("cartesian", models, Plot(per_channel=True, angles=(30.0,)))
    assert [curve.name for curve in panel.curves] == ["R", "G", "B"]
    np.testing.assert_allclose([curve.y[0] * np.pi for curve in panel.curves], [0.9, 0.5, 0.1])
    (whole,) = panels("cartesian", models, Plot(angles=(30.0,)))
    assert whole.curves[0].y[0] * np.pi == pytest.approx(0.2126 * 0.9 + 0.7152 * 0.5 + 0.0722 * 0.1, rel=1e-3)


def test_curves_differ_in_grey():
    assert len({style(number).dashes for number in range(5)}) == 5
    assert len({style(number) for number in range(35)}) == 35


def test_a_figure_has_the_width_and_words_of_its_user(tmp_path):
    path = tmp_path / "figure.svg"
    plot = Plot(("cartesian", "albedo"), overlay=True, width=7.0, labels=("Johann", r"$\alpha$ & 2"))
    draw_brdfs(["lambert", "oren_nayar"], output=path, plot=plot)
    text = path.read_text()
    assert 'width="504pt"' in text
    for word in ("Johann", "angle of view", "albedo"):
        assert f">{word}" in text  # text, no outlines
    assert "-90" not in text.partition("<text")[0]


def test_a_pdf_has_fonts_and_no_date_and_is_the_same_twice(tmp_path):
    one, two = tmp_path / "one.pdf", tmp_path / "two.pdf"
    for path in (one, two):
        draw_brdfs(["phong"], output=path, plot=Plot(("polar", "sphere", "lobe")))
    assert one.read_bytes() == two.read_bytes()
    assert b"/FontFile2" in one.read_bytes()
    assert b"Date" not in one.read_bytes()


@pytest.mark.parametrize(
    ("labels", "fact"),
    [
        (("one",), "1 for 2 models; give one for each"),
        (("same", "same"), "two models have the same"),
        (("one", r"$\nonsense$"), "is no formula"),
    ],
)
def test_faulty_labels_are_refused(tmp_path, labels, fact):
    with pytest.raises(InputError, match=fact):
        draw_brdfs(["lambert", "phong"], output=tmp_path / "x.svg", plot=Plot(("polar",), labels=labels))
    assert not list(tmp_path.iterdir())


def test_the_command_knows_all_views():
    (views,) = (option for option in brdf.params if option.name == "views")
    assert tuple(views.type.choices) == (*VIEWS, "all")
    assert tuple(views.default) == DEFAULT_VIEWS == Plot().views


# --- MERL tables --------------------------------------------------------------------------------------------


def test_a_model_written_as_a_merl_table_is_read_as_itself(tmp_path):
    path = tmp_path / "burley.binary"
    assert write_merl(["burley"], COPPER, path) == ([], [])
    assert write_merl(["burley"], COPPER, path) == ([path], [])
    for incidence in (0, 30, 70):
        angles, found = polar_slice(only("merl", f"file={path}"), incidence)
        expected = polar_slice(only("burley", *COPPER), incidence)[1]
        inner = np.abs(angles) < 80
        np.testing.assert_allclose(found[inner], expected[inner], rtol=0.01)


def test_what_a_merl_table_cannot_hold_is_said(tmp_path):
    path = tmp_path / "table.binary"
    with pytest.raises(InputError, match="holds one model, and 2 are named"):
        write_merl(["burley", "lambert"], [], path)
    with pytest.raises(InputError, match="ward is anisotropic"):
        write_merl(["ward"], [], path)
    with pytest.raises(InputError, match=r"is written as \.binary"):
        write_merl(["lambert"], [], tmp_path / "table.bin")
    assert not path.exists()
    notes = write_merl(["phong"], [], path)[1]
    assert notes == [f"phong changes if light and eye are exchanged; {path} holds the mean of both"]
