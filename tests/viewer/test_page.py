"""The page of `illum view` in a real Chromium."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.images.reader import read_image
from illumcli.viewer import session as sessions
from viewing import ViewPage, control, served

keys = pytest.importorskip("selenium.webdriver.common.keys", reason="needs selenium").Keys


@pytest.fixture
def open_page(chromium, viewer):
    """Opens windows of the view; their consoles must stay empty."""
    first = chromium.current_window_handle

    def opened(url=viewer.url):
        chromium.switch_to.new_window("window")
        chromium.set_window_size(900, 700)
        chromium.get(url)
        page = ViewPage(chromium)
        page.wait("document.querySelector('#size').options.length")
        page.set("#size", "96 × 54")
        page.drawn()
        return page

    yield opened
    for handle in chromium.window_handles:
        if handle != first:
            chromium.switch_to.window(handle)
            chromium.close()
    chromium.switch_to.window(first)
    assert [entry for entry in chromium.get_log("browser") if entry["source"] != "rendering"] == []


@pytest.fixture
def page(open_page):
    """A window of the view."""
    return open_page()


def test_a_drag_moves_the_camera(page):
    before = page.pixel(0.5, 0.5)
    page.drag("#frame", by=(80, -20))
    page.drawn()
    turned = page.pixel(0.5, 0.2)
    page.drag("#frame", by=(0, 60), start=(10, 10))
    page.drawn()
    assert page.pixel(0.5, 0.2) != turned
    assert before[0] > before[2]  # the red ball is in the middle


def test_the_pixel_under_the_mouse(page):
    page.point("#frame").perform()
    page.wait("document.querySelector('[data-fact=place]').textContent.endsWith('ball · clay')")
    assert page.fact("value").startswith("R 0.")


def test_a_slider_changes_the_picture(page):
    red, *_ = page.pixel(0.5, 0.5)
    slider = page.one(control("materials.clay.diffuse", "[type=range]"))
    slider.send_keys(keys.HOME)
    page.drawn()
    darker, *_ = page.pixel(0.5, 0.5)
    assert darker < red - 20
    assert page.value("materials.clay.diffuse") == "0"
    slider.send_keys(keys.END)
    page.drawn()
    assert page.pixel(0.5, 0.5)[0] > red

    # back to the file, by the button of the control
    page.one(control("materials.clay.diffuse", "button.reset")).click()
    page.drawn()
    assert page.pixel(0.5, 0.5)[0] == red
    assert page.value("materials.clay.diffuse") == "0.6"
    assert not page.one("#reset").is_enabled()


def test_a_number_a_color_a_vector_a_switch_and_a_light(page):
    before = page.pixel(0.5, 0.5)
    page.set(control("materials.clay.diffuse", "[type=color]"), "#00ff00")
    page.drawn()
    assert np.argmax(page.pixel(0.5, 0.5)) == 1
    assert [page.value("materials.clay.diffuse", k) for k in range(3)] == ["0", "1", "0"]

    # a number refuses what the description refuses, and says why
    page.open("camera")
    number = page.one(control("camera.fov", "[type=number]"))
    number.send_keys(keys.CONTROL, "a", keys.NULL, "400", keys.ENTER)
    page.wait("!document.querySelector('#problem').hidden")
    assert "camera.fov" in page.one("#problem").text
    number.send_keys(keys.CONTROL, "a", keys.NULL, "20", keys.ENTER)
    page.wait("document.querySelector('#problem').hidden")
    page.drawn()

    page.open("lights.key")
    page.drag(control("lights.key.position", ".scrub"), by=(60, 0))
    page.drawn()
    assert float(page.value("lights.key.position")) > -2
    lit = page.pixel(0.5, 0.3)
    page.one("[data-light=key]").click()
    page.drawn()
    assert sum(page.pixel(0.5, 0.3)) < sum(lit)
    page.one("[data-light=key]").click()
    page.one("#reset").click()
    page.drawn()
    assert page.pixel(0.5, 0.5) == before


def test_models_are_switched_and_undone(page):
    before = page.pixel(0.45, 0.4)
    page.set(control("materials.clay.model", "select"), "ward")
    page.wait("document.querySelector(arguments[0])", control("materials.clay.alpha_x", "input"))
    page.drawn()
    groups = "[...document.querySelectorAll('details')].slice(0, 2).map((each) => each.dataset.group)"
    assert page(groups) == ["materials.clay", "materials.floor"]
    assert page.pixel(0.45, 0.4) != before
    page.press(keys.CONTROL + "z")
    page.wait("document.querySelector(arguments[0])", control("materials.clay.exponent", "input"))
    page.drawn()
    assert page.pixel(0.45, 0.4) == before
    page.one("#redo").click()
    page.wait("document.querySelector(arguments[0])", control("materials.clay.alpha_x", "input"))


def test_layers_exposure_and_size(page):
    before = page.pixel(0.5, 0.5)
    page.set("#exposure", 2)
    page.drawn()
    assert sum(page.pixel(0.5, 0.5)) > sum(before)
    page.set("#layer", "normal")
    page.set("#size", "48 × 27")
    page.drawn()
    assert page.fact("size") == "48 × 27"
    assert page("document.querySelector('#now').width") == 48
    page.set("#size", "fit")
    page.drawn()
    assert page("document.querySelector('#now').width") > 300
    red, green, blue = page.pixel(0.5, 0.5)
    assert blue > max(red, green)  # the normal there points to the eye


def test_the_chosen_size_stays_that_share_of_another_film(page):
    page.set("#size", "48 × 27")
    page.drawn()
    page.set(control("film.width", "[type=number]"), 128)
    page.wait("document.querySelector('#size').value === '64 × 27'")
    page.drawn()
    assert page.fact("size") == "64 × 27"


def test_what_was_refused_is_no_step_to_undo(page):
    page.set(control("materials.clay.exponent", "[type=number]"), 50)
    page.drawn()
    page.set(control("materials.clay.exponent", "[type=number]"), -5)
    page.wait("!document.querySelector('#problem').hidden")
    page.drawn()
    page.one("#undo").click()
    page.drawn()
    assert page.value("materials.clay.exponent") == "20"


def test_a_colour_that_is_left_out_looks_it(page):
    fields = control("materials.clay.ambient", "[type=number]")
    numbers = "[...document.querySelectorAll(arguments[0])].map((each) => each.value)"
    assert page(numbers, fields) == ["", "", ""]
    page.set(fields, 0.5)
    page.drawn()
    assert page(numbers, fields) == ["0.5", "0", "0"]
    page.set(fields, "")
    page.drawn()
    page.wait(f"({numbers}).join() === ',,'", fields)
    assert page("document.querySelector('#reset').disabled")


def test_the_error_of_a_reconstructed_picture_stays_beside_the_full_one(
    open_page, own_viewer, scene, monkeypatch
):
    monkeypatch.setattr(sessions, "LONG", 0.0)
    scene.write_text(scene.read_text().replace("samples: 1", "samples: 4"))
    page = open_page(own_viewer.url)
    assert page.fact("stage") == "full"
    before = page.fact("error")
    assert before.startswith("reconstructed: error ± 0.0")
    page.set(control("materials.clay.exponent", "[type=number]"), 60)
    page.drawn()
    assert page.fact("error") == before.replace("reconstructed", "earlier picture")
    page.set("#layer", "normal")
    page.drawn()
    assert page.fact("error") == ""
    page.open("obscurance")
    page.set("#layer", "beauty")
    page.one(control("obscurance.reconstruct", "[type=checkbox]")).click()
    page.drawn()
    assert page.fact("error").startswith("error ± 0.0")


def test_a_broken_file_keeps_the_picture_until_it_is_mended(open_page, own_viewer, scene):
    page = open_page(own_viewer.url)
    text = scene.read_text()
    before = page.pixel(0.5, 0.5)
    scene.write_text(text.replace("model: phong", "model: phnog"))
    page.wait("!document.querySelector('#problem').hidden")
    message = page.one("#problem").text
    assert "ball.yaml:7:" in message
    assert "did you mean 'phong'?" in message
    assert page.pixel(0.5, 0.5) == before
    scene.write_text(text.replace("diffuse: [0.6, 0.2, 0.1]", "diffuse: [0.1, 0.2, 0.6]"))
    page.wait("document.querySelector('#problem').hidden")
    page.wait(
        "document.querySelector('[data-path=\"materials.clay.diffuse\"] [type=number]').value === '0.1'"
    )
    page.drawn()
    assert page.pixel(0.5, 0.5)[2] > page.pixel(0.5, 0.5)[0]


def test_windows_have_edits_of_their_own_that_outlive_a_reload(open_page):
    first = open_page()
    before = first.pixel(0.5, 0.5)
    window = first.browser.current_window_handle
    first.set(control("materials.clay.diffuse", "[type=color]"), "#0000ff")
    first.set("#exposure", 1)
    first.drawn()
    blue = first.pixel(0.5, 0.5)
    second = open_page()
    assert second.pixel(0.5, 0.5) == before
    second.browser.switch_to.window(window)
    assert first.pixel(0.5, 0.5) == blue
    first.browser.refresh()
    well = control("materials.clay.diffuse", "[type=color]")
    first.wait("document.querySelector(arguments[0])?.value === '#0000ff'", well)
    first.set("#size", "96 × 54")
    first.drawn()
    assert first.pixel(0.5, 0.5) == blue
    assert first("document.querySelector('#exposure').value") == "1"


def test_a_frozen_picture_beside_the_one_of_now(page, tmp_path):
    before = page.pixel(0.25, 0.5)
    page.press("f")
    page.set("#exposure", 3)
    page.drawn()
    assert page.pixel(0.25, 0.5, "#frozen") == before
    assert page.pixel(0.25, 0.5) != before

    # what the screen shows: the frozen picture on the left of the handle
    page.drag("#split", by=(-40, 0))
    split = page("Number(document.querySelector('#split').ariaValueNow)")
    assert 20 < split < 45
    page.one("#split").send_keys(keys.ARROW_LEFT)
    assert page("Number(document.querySelector('#split').ariaValueNow)") == split - 1
    (tmp_path / "screen.png").write_bytes(page.one("#frame").screenshot_as_png)
    seen = read_image(tmp_path / "screen.png")
    for x, canvas in ((0.1, "#frozen"), (0.9, "#now")):
        row, column = seen.height // 2, int(seen.width * x)
        color = [255 * float(seen.channels[name][row, column]) for name in "RGB"]
        np.testing.assert_allclose(color, page.pixel(x, 0.5, canvas), atol=2)
    page.one("#freeze").click()
    assert not page.one("#split").is_displayed()


def test_save_and_copy_command(open_page, own_viewer, scene):
    page = open_page(own_viewer.url)
    page.browser.execute_cdp_cmd(
        "Browser.grantPermissions", {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]}
    )
    page.set(control("materials.clay.exponent", "[type=number]"), 60)
    page.drawn()
    page.one("#command").click()
    page.wait("document.querySelector('#command-copied').textContent.startsWith('Copied')")
    command = page.one("#command-text").text
    assert command.startswith("illum render")
    assert "materials.clay.exponent=60" in command
    copied = "const done = arguments[0]; navigator.clipboard.readText().then(done)"
    assert page.browser.execute_async_script(copied) == command
    page.one("#command-dialog [data-close]").click()

    page.one("#save").click()
    assert page.one("#save-file").get_attribute("value") == str(scene.with_name("ball-edited.yaml"))
    page.one("#save-dialog .main").click()
    page.wait("!document.querySelector('#save-dialog').open")
    saved = scene.with_name("ball-edited.yaml")
    assert "exponent: 60" in saved.read_text()

    # a file of other content is replaced only if that is asked for
    page.set(control("materials.clay.exponent", "[type=number]"), 70)
    page.drawn()
    page.one("#save").click()
    page.one("#save-dialog .main").click()
    page.wait("!document.querySelector('#save-problem').hidden")
    assert "ball-edited.yaml" in page.one("#save-problem").text
    page.one("#save-replace").click()
    page.one("#save-dialog .main").click()
    page.wait("!document.querySelector('#save-dialog').open")
    assert "exponent: 70" in saved.read_text()


def test_the_material_that_is_clicked_is_shown_with_its_lobes(page):
    page.press("b")
    page.wait("document.querySelector('#cards .name')?.textContent === 'clay'")
    page.settle()
    page.point("#frame", 0, 0.45 * page.one("#frame").size["height"]).click().perform()
    page.wait("document.querySelector('#cards .name').textContent === 'floor'")
    assert page("document.querySelector('details[data-group=\"materials.floor\"]').open")
    page.set("#lobe-add", "model:ward")
    page.wait("document.querySelectorAll('#cards .solid').length === 2")

    # the light is turned by a drag on a lobe and on the slices, and changes what is drawn
    drawn = "document.querySelector('#cards .solid').toDataURL()"
    before = page(drawn)
    page.drag("#cards .solid", by=(30, 40))
    page.wait(f"{drawn} !== arguments[0]", before)
    assert page("Number(document.querySelector('#theta').value)") > 45
    page.drag("#slices", by=(0, 0), start=(10, -60))
    page.wait("Number(document.querySelector('#theta').value) < 30")
    page.one("#log").click()
    page.one("#cosine").click()
    page.one("#cards .quiet").click()
    page.wait("document.querySelectorAll('#cards .card').length === 1")


def test_parameters_are_filtered_and_explained(page):
    page.press("/")
    page.press("expon")
    shown = "[...document.querySelectorAll('.control')].filter((each) => each.checkVisibility())"
    assert page(f"{shown}.map((each) => each.dataset.path)") == ["materials.clay.exponent"]
    page.point(control("materials.clay.exponent", ".label")).perform()
    page.wait("document.querySelector('#help').textContent.includes('in the file 20')")
    page.one("#filter").clear()
    page.one("#changed-only").click()
    assert page(f"{shown}.length") == 0


def test_what_a_server_that_has_ended_leaves(chromium, scene):
    with served(scene) as viewer:
        chromium.get(viewer.url)
        page = ViewPage(chromium)
        page.drawn()
        before = page.pixel(0.5, 0.5)
    page.wait("!document.querySelector('#lost').hidden")
    assert page.pixel(0.5, 0.5) == before
    chromium.get("about:blank")
    chromium.get_log("browser")  # it holds the attempts to connect again


def test_every_control_has_a_name(page):
    page.press("b")
    page.wait("document.querySelector('#cards .solid')")
    page.browser.execute_script("for (const each of document.querySelectorAll('details')) each.open = true")
    page.press("f")
    things = "button, input, select, canvas[role], [role=application], [role=slider], aside, body > section"
    nameless = [
        each.get_attribute("outerHTML")[:120]
        for each in page.all(f":is({things})")
        if each.is_displayed() and not any(map(str.isalnum, each.accessible_name))
    ]
    assert nameless == []


@pytest.mark.parametrize("width", [1000, 1600])
def test_nothing_is_wider_than_the_window(page, width):
    page.browser.set_window_size(width, 700)
    page.press("b")
    page.browser.execute_script("for (const each of document.querySelectorAll('details')) each.open = true")
    page.settle()
    assert page("document.documentElement.scrollWidth <= innerWidth")
    assert page("document.documentElement.scrollHeight <= innerHeight")
    for part in map(page.one, ("#panel", "#groups", "#bar", "#stage", "#lobes")):
        assert page("arguments[0].scrollWidth <= arguments[0].clientWidth", part)
