"""The report in a real Chromium, opened from disk: filters, order, views, comparison, keys."""

from __future__ import annotations

import functools
import http.server
import threading

import numpy as np
import pytest

from chromium import Page
from illumcli.color import from_srgb, to_srgb
from illumcli.html_report.entries import Contents, Entry, Picture
from illumcli.html_report.folder import write_report
from illumcli.images.reader import read_image
from painted import painted, write_picture

keys = pytest.importorskip("selenium.webdriver.common.keys", reason="needs selenium").Keys


class ReportPage(Page):
    """The page of a report in the browser."""

    def choose(self, name, value):
        """Chooses one of several radio buttons."""
        self.browser.execute_script(
            "document.querySelector(`input[name=${arguments[0]}][value=${arguments[1]}]`).click()",
            name,
            value,
        )

    def shown(self):
        """Numbers of the cards that exist, in the order of the document."""
        return self(
            "[...document.querySelectorAll('#main button.open')].map((each) => Number(each.dataset.index))"
        )

    def compare(self, a, b, mode="slider"):
        self.browser.execute_script(
            "app.take('a', arguments[0]); app.take('b', arguments[1]); compareSides()", a, b
        )
        self.wait(
            "compareStage.b !== null && compareStage.b.index === arguments[0]".replace("arguments[0]", str(b))
        )
        self.choose("mode", mode)


@pytest.fixture
def page(chromium, report):
    """The report, opened from disk; the console must have stayed empty."""
    chromium.set_window_size(1300, 900)
    chromium.get((report / "index.html").as_uri())
    page = ReportPage(chromium)
    page.wait("document.querySelectorAll('button.open').length > 10")
    yield page
    assert [entry for entry in chromium.get_log("browser") if entry["source"] != "rendering"] == []


def test_all_variants_are_shown_with_thumbnails(page):
    assert page("document.querySelector('#count').textContent") == "60 of 60 variants"
    page.wait(
        "[...document.querySelectorAll('#main img')].every((each) => each.complete && each.naturalWidth > 0)"
    )
    assert page.shown()[:9] == list(range(9))
    assert "1 failed" in page.one("#summary").text
    assert "no model" in page.one("button.open[data-index='7']").text
    assert page("performance.getEntries().every((each) => !each.name.startsWith('http'))")


def test_filters(page):
    count = "document.querySelector('#count').textContent"
    exponent = "fieldset[data-filter=p0] label:nth-of-type({})"
    page.one(exponent.format(1)).click()
    page.wait(f"{count} === '12 of 60 variants'")
    page.one(exponent.format(3)).click()
    page.wait(f"{count} === '24 of 60 variants'")
    assert set(page("app.order")) == {*range(12), *range(24, 36)}
    page.one("fieldset[data-filter=p1] label:nth-of-type(2)").click()
    page.wait(f"{count} === '6 of 60 variants'")
    assert page.shown() == [3, 4, 5, 27, 28, 29]

    # a measure, from and to; the variant that failed has none
    page.one("button[type=reset]").click()
    page.wait(f"{count} === '60 of 60 variants'")
    low, high = page.all("fieldset[data-filter=mrays] input")
    low.send_keys("6000")
    high.send_keys("9000")
    page.wait(f"{count} === '3 of 60 variants'")
    assert page.shown() == [6, 8, 9]

    # words of labels and messages, and what nothing passes
    page.one("button[type=reset]").click()
    page.wait(f"{count} === '60 of 60 variants'")
    page.one("#search").send_keys("Ward 0.3")
    page.wait(f"{count} === '5 of 60 variants'")
    page.one("#search").clear()
    page.one("#search").send_keys("no model")
    page.wait(f"{count} === '1 of 60 variants'")
    page.one("#search").send_keys(" there")
    page.wait(f"{count} === '0 of 60 variants'")
    assert page.shown() == []


def test_order(page):
    seconds = [0.5 + (number * 7) % 60 for number in range(60)]
    expected = sorted((k for k in range(60) if k != 7), key=seconds.__getitem__)
    page.set("#sort", "mseconds")
    assert page("app.order") == [*expected, 7]
    assert page.shown()[:3] == expected[:3]
    page.one("#direction").click()
    assert page("app.order") == [*expected[::-1], 7]  # what was not measured comes last either way

    # in the table a click on a column's head sorts, a second one turns it round
    page.choose("view", "table")
    head = page.one("th:nth-child(3) button")
    head.click()
    assert page("app.order")[:2] == [0, 1]
    assert page.one("th:nth-child(3)").get_attribute("aria-sort") == "ascending"
    head.click()
    assert page("app.order")[:2] == [48, 49]
    assert page.one("th:nth-child(3)").get_attribute("aria-sort") == "descending"
    assert page.one("tr[aria-rowindex='2'] td:nth-child(3)").text == "512"


def test_grid(page):
    page.choose("view", "grid")
    page.set("#axis-x", "1")
    page.set("#axis-y", "0")
    names = "[...document.querySelectorAll('.grid [role={}]')].map((each) => each.textContent)"
    assert page(names.format("columnheader"))[1:] == ["0.1", "0.2", "0.3", "0.4"]
    assert page(names.format("rowheader")) == ["2", "8", "32", "128", "512"]
    assert page.shown() == list(range(0, 60, 3))
    page.set("#held-2", "1")
    assert page("document.querySelector('output[for=held-2]').textContent") == "ward"
    assert page.shown() == list(range(1, 60, 3))
    page.set("#held-2", "-1")
    assert page.one(".cell .more").text == "+2"
    page.one("fieldset[data-filter=p1] label:nth-of-type(2)").click()
    page.wait("document.querySelectorAll('.grid .head').length === 1")
    # the axes change places rather than being the same
    page.set("#axis-y", "1")
    assert page("[app.axes.x, app.axes.y]") == [0, 1]


def test_keys_lead_everywhere(page):
    active = "document.activeElement.dataset.index"
    columns = page("app.view.columns")
    page.one("button.open").send_keys(keys.ARROW_RIGHT)
    assert page(active) == "1"
    page.press(keys.ARROW_DOWN)
    assert page(active) == str(1 + columns)
    page.press(keys.END)
    assert page(active) == "59"
    page.press(keys.HOME, keys.ARROW_RIGHT, "a", keys.ARROW_RIGHT, "b")
    assert page("[app.sides.a, app.sides.b]") == [1, 2]
    assert page("document.querySelector('.side[data-side=b][aria-pressed=true]').tabIndex") == 0

    # Enter opens a variant, arrows go on to others, Escape leads back to the card
    page.press(keys.ENTER)
    assert page("details.open")
    page.press(keys.ARROW_RIGHT)
    assert page.one("#details-title").text.startswith("4: ")
    page.press(keys.ESCAPE)
    page.wait(f"{active} === '3'")

    # C compares, a number chooses the way
    page.press("c")
    page.wait("compare.open && compareStage.b !== null")
    page.press("4")
    assert page.one("input[value=difference]").is_selected()
    page.press("x")
    page.wait("compareStage.a?.index === 2")
    page.press(keys.ESCAPE)
    page.wait(f"{active} === '3'")
    page.press("/")
    assert page("document.activeElement.id") == "search"
    page.press(keys.ESCAPE)
    page.press("?")
    assert page.one("#help").is_displayed()


def test_only_the_active_card_is_on_the_way_of_the_tab_key(page):
    assert (
        page("[...document.querySelectorAll('#main button')].filter((each) => each.tabIndex === 0).length")
        == 3
    )


def test_values_of_the_pixel_under_the_pointer(page):
    page.browser.execute_script("openDetails(9)")
    page.wait("detailsStage.a?.picture === REPORT.pictures[9][0]")
    page.browser.execute_script(
        """
        const box = document.querySelector('#details canvas.a').getBoundingClientRect();
        const [clientX, clientY] = [box.left + box.width * 5.5 / 16, box.top + box.height * 2.5 / 9];
        const moved = new PointerEvent('pointermove', {clientX, clientY, bubbles: true});
        document.querySelector('#details .surface').dispatchEvent(moved);
        """
    )
    cells = [float(cell) for cell in readout(page, "#details")[1][1:]]
    expected = from_srgb(painted(9)[2, 5] / 255) / 2  # the exposure is one stop
    np.testing.assert_allclose(cells, expected, rtol=1e-4)
    assert page.one("#details .readout th").text == "5, 2"
    page.one("#details .surface").send_keys(keys.ARROW_RIGHT, keys.SHIFT + keys.ARROW_LEFT)
    assert page.one("#details .readout th").text == "0, 2"


def test_a_copied_command(page):
    page.browser.execute_script("openDetails(9)")
    assert page.one("#details pre").text == "illum render teapot.yaml -D ambient=0.4 -o out/9.png"
    page.one("#details pre ~ .row button").click()
    page.wait("document.querySelector('#details pre ~ .row output').textContent === 'copied'")


def readout(page, dialog):
    """Texts of the cells of the table of values, row by row."""
    rows = "[...document.querySelectorAll(`${arguments[0]} .readout tr`)]"
    return page(f"{rows}.map((row) => [...row.cells].map((cell) => cell.textContent))", dialog)


def pixel(page, name, x, y):
    """R, G and B of a canvas of the comparison."""
    context = "document.querySelector(`#compare canvas.${arguments[0]}`).getContext('2d')"
    return page(f"[...{context}.getImageData(arguments[1], arguments[2], 1, 1).data.slice(0, 3)]", name, x, y)


def test_slider(page, tmp_path):
    page.compare(3, 20)
    assert pixel(page, "a", 4, 5) == painted(3)[5, 4].tolist()
    assert pixel(page, "b", 4, 5) == painted(20)[5, 4].tolist()
    clip = "getComputedStyle(document.querySelectorAll('#compare .frame')[1]).clipPath"
    assert page(clip) == "inset(0px 0px 0px 50%)"
    page.one("#split").send_keys(keys.ARROW_RIGHT, keys.ARROW_RIGHT)
    assert page(clip) == "inset(0px 0px 0px 51%)"

    # dragging in the picture moves it, too
    page.browser.execute_script("""
        const surface = document.querySelector('#compare .surface');
        const box = document.querySelector('#compare .frame').getBoundingClientRect();
        const at = {clientX: box.left + box.width / 4, clientY: box.top + 9, buttons: 1, bubbles: true};
        surface.dispatchEvent(new PointerEvent('pointermove', at));
    """)
    page.wait("Math.abs(Number(document.querySelector('#split').value) - 25) < 1")

    # what the screen shows: A on the left, B on the right
    page.browser.execute_script("compareStage.setSplit(0.5)")
    screen = page.one("#compare .surface").screenshot_as_png
    (tmp_path / "screen.png").write_bytes(screen)
    seen = read_image(tmp_path / "screen.png")
    for number, x in ((3, 2), (20, 13)):
        row, column = seen.height * 5 // 9, int(seen.width * (x + 0.5) / 16)
        color = [round(255 * float(seen.channels[name][row, column])) for name in "RGB"]
        np.testing.assert_allclose(color, painted(number)[4, x], atol=10)  # the screen interpolates


def test_difference(page):
    page.compare(3, 20, "difference")
    a, b = (from_srgb(painted(number) / 255) / 2 for number in (3, 20))
    gain = 2 ** float(page.one("#gain").get_attribute("value"))
    assert 0.5 < gain * np.abs(b - a).max() <= 1
    page.set("#gain", "0")
    expected = 255 * to_srgb(np.abs(b - a)[5, 4])
    np.testing.assert_allclose(pixel(page, "d", 4, 5), expected, atol=1)
    page.set("#gain", "2")
    np.testing.assert_allclose(
        pixel(page, "d", 4, 5), 255 * to_srgb(np.minimum(1, 4 * np.abs(b - a)[5, 4])), atol=1
    )
    rmse = float(np.sqrt(np.square(b - a).mean()))
    assert f"RMSE {rmse:.4g}" in page.one("#compare .message").text
    page.one("#largest").click()
    differences = [float(cell) for cell in readout(page, "#compare")[-1][1:]]
    assert np.abs(differences).max() == pytest.approx(np.abs(b - a).max(), rel=1e-3)


def test_flicker_changes_by_itself_only_for_those_who_like_motion(page):
    front = "document.querySelector('#compare .surface').dataset.front"
    page.compare(3, 20, "flicker")
    page.wait(f"{front} === 'b'")
    page.wait(f"{front} === 'a'")
    page.one("#flicker-run").click()
    assert page("flickerTimer") == 0
    before = page(front)
    page.one("#compare .surface").send_keys(" ")
    assert page(front) != before

    page.browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-reduced-motion", "value": "reduce"}]}
    )
    try:
        page.choose("mode", "slider")
        page.choose("mode", "flicker")
        assert page("flickerTimer") == 0
    finally:
        page.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_nothing_in_the_data_is_read_as_html(page):
    page.browser.execute_script("openDetails(7)")
    assert "<script>window.hacked=1</script>" in page.one("#details .facts").text
    page.browser.execute_script("details.close()")
    for view in ("grid", "table", "gallery"):
        page.choose("view", view)
    page.compare(2, 5)
    assert "<script>" in page.one("#compare .slot .name").text
    assert page("document.title").startswith("<script>")
    assert page("window.hacked === undefined")
    assert page("[...document.scripts].every((each) => each.src && !each.textContent)")


def test_every_control_has_a_name(page):
    page.browser.execute_script("app.take('a', 1); app.take('b', 2)")
    nameless = []
    for opened, root in (("true", ""), ("openDetails(1)", "#details"), ("compareSides()", "#compare")):
        page.browser.execute_script("for (const each of document.querySelectorAll('dialog')) each.close()")
        page.browser.execute_script(opened)
        page.settle()
        if root:
            assert page.one(root).accessible_name
        controls = page.all(f"{root} :is(button, input, select, [role=application], [role=toolbar])")
        nameless += [
            control.get_attribute("outerHTML")[:120]
            for control in controls
            if control.is_displayed() and not any(map(str.isalnum, control.accessible_name))
        ]
    assert nameless == []


@pytest.mark.parametrize("width", [320, 390, 1300])
def test_nothing_is_wider_than_the_window(page, width):
    size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
    page.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        page.browser.refresh()
        page.wait("document.querySelectorAll('button.open').length > 1")
        for step in (
            "true",
            "app.setView('grid')",
            "app.setView('table')",
            "openDetails(1)",
            "compareSides()",
        ):
            page.browser.execute_script(f"app.sides.a = 1; app.sides.b = 2; showTray(); {step}")
            assert page("document.documentElement.scrollWidth <= innerWidth"), step
            dialogs = "[...document.querySelectorAll('dialog[open]')]"
            assert page(f"{dialogs}.every((each) => each.scrollWidth <= each.clientWidth)"), step
        if width < 800:
            page.browser.execute_script("details.close(); compare.close()")
            page.one("#filters-toggle").click()
            assert page.one("#filters").is_displayed()
    finally:
        page.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_two_thousand_variants_make_few_nodes(chromium, tmp_path):
    path = write_picture(tmp_path / "a.png", painted(1))
    picture = Picture(path, "0" * 32, 0.0)
    entries = tuple(
        Entry(
            label=f"a {k // 50}, b {k % 50}",
            values={"a": str(k // 50), "b": str(k % 50)},
            content=f"{k:032x}",
            state="rendered",
            command="illum",
            measures={"rays": float(k)},
            pictures={"beauty": picture},
        )
        for k in range(2000)
    )
    write_report(tmp_path / "report", Contents("many", entries, 1.0, 9 / 16))
    chromium.get((tmp_path / "report" / "index.html").as_uri())
    page = ReportPage(chromium)
    page.wait("document.querySelectorAll('button.open').length > 10")
    for view in ("gallery", "grid", "table"):
        page.choose("view", view)
        assert page("document.querySelectorAll('#main *').length") < 1500
        page.browser.execute_script("app.activate(1999); app.focus()")
        page.wait("document.activeElement.dataset.index === '1999'")
        assert page("document.querySelectorAll('#main *').length") < 1500
    assert page("document.querySelectorAll('#main tr').length") < 60


def test_from_a_web_server_it_is_the_same(chromium, report):
    handler = functools.partial(QuietHandler, directory=str(report))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            chromium.get(f"http://127.0.0.1:{server.server_port}/")
            page = ReportPage(chromium)
            page.wait("document.querySelectorAll('button.open').length > 10")
            page.compare(3, 20)
            assert pixel(page, "b", 4, 5) == painted(20)[5, 4].tolist()
        finally:
            chromium.get("about:blank")
            server.shutdown()
            thread.join()


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    """Serves files without a word."""

    def log_message(self, *_):
        pass


def test_light_beyond_white_and_missing_values_are_told(chromium, tmp_path):
    linear = np.full((4, 6, 3), 0.25, np.float32)
    linear[1, 2] = 3.5, 1 / 3, 1e-5
    exr = write_picture(tmp_path / "a.exr", linear.astype(np.float16))
    white = np.full((4, 6, 3), 255, np.uint8)
    png = write_picture(tmp_path / "a.png", white)
    entries = tuple(
        Entry(
            name,
            {"a": name},
            name * 32,
            "rendered",
            "illum",
            pictures={"beauty": Picture(path, name * 32, 0.0)},
        )
        for name, path in (("a", exr), ("b", png))
    )
    folder = tmp_path / "report"
    write_report(folder, Contents("light", entries, 1.0, 4 / 6))
    chromium.get((folder / "index.html").as_uri())
    page = ReportPage(chromium)
    page.wait("document.querySelectorAll('button.open').length === 2")
    page.compare(0, 1)
    page.browser.execute_script("compareStage.goTo(2, 1)")
    rows = readout(page, "#compare")
    half = [float(np.float16(value)) for value in (3.5, 1 / 3, 1e-5)]
    np.testing.assert_allclose([float(cell) for cell in rows[1][1:]], half, rtol=1e-3)
    assert rows[2][1:] == ["≥ 1"] * 3

    # a picture whose script is gone: the message says so
    (folder / "pictures" / f"{entries[1].pictures['beauty'].identity}.js").unlink()
    chromium.refresh()
    page.wait("document.querySelectorAll('button.open').length === 2")
    page.browser.execute_script("openDetails(1)")
    page.wait("document.querySelector('#details .message').textContent.includes('are missing')")
    chromium.get_log("browser")  # it says, too, which file is missing


def test_the_picture_to_show_is_chosen_among_layers_and_cameras(chromium, tmp_path):
    entries = []
    for number in range(2):
        names = {"beauty": 10 * number + 1, "depth": 10 * number + 2}
        pictures = {
            name: Picture(write_picture(tmp_path / f"{seed}.png", painted(seed)), f"{seed:032x}", 0.0)
            for name, seed in names.items()
        }
        pictures = pictures if number else {"beauty": pictures["beauty"]}
        entries.append(Entry("", {}, f"{number:032x}", "rendered", "illum", pictures=pictures))
    write_report(tmp_path / "report", Contents("layers", tuple(entries), 1.0, 9 / 16))
    chromium.get((tmp_path / "report" / "index.html").as_uri())
    page = ReportPage(chromium)
    page.wait("document.querySelectorAll('button.open').length === 2")
    assert page.all("input[value=grid]") == []  # nothing varies
    page.set("#picture", "1")
    assert page.one("button.open[data-index='0']").text == "no such picture\nvariant 1"
    page.browser.execute_script("openDetails(1)")
    page.wait("detailsStage.a?.picture === REPORT.pictures[1][1]")
    assert [link.text for link in page.all("#details a")] == ["../11.png", "../12.png"]
    assert chromium.get_log("browser") == []
