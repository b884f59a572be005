"""The page of `illum view` in a real Chromium."""

from __future__ import annotations

import pytest

from chromium import Page

webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium")


class ViewPage(Page):
    """A window of the live view."""

    def drawn(self):
        """Waits for the full picture of all that was done so far."""
        self.wait("document.querySelector('#status').dataset.stage === 'full'")

    def pixel(self, x, y, canvas="#now"):
        """R, G and B of the picture at a place, in fractions of its size."""
        return self(
            """(([canvas, x, y]) => [...canvas.getContext('2d').getImageData(
                Math.floor(x * canvas.width), Math.floor(y * canvas.height), 1, 1).data.slice(0, 3)])
            ([document.querySelector(arguments[2]), arguments[0], arguments[1]])""",
            x,
            y,
            canvas,
        )

    def fact(self, name):
        """A text of the line of state."""
        return self("document.querySelector(`[data-fact=${arguments[0]}]`).textContent", name)

    def drag(self, selector, *, by, start=(0, 0)):
        """Presses the mouse at a distance from the middle of an element, moves it, and lets go."""
        element = self.one(selector)
        actions = webdriver.ActionChains(self.browser, duration=30)
        actions.move_to_element_with_offset(element, *start).click_and_hold()
        actions.move_by_offset(*by).release().perform()


@pytest.fixture
def open_page(chromium, viewer):
    """Opens windows of the view; their consoles must stay empty."""
    first = chromium.current_window_handle

    def opened(url=viewer.url):
        chromium.switch_to.new_window("window")
        chromium.set_window_size(900, 500)
        chromium.get(url)
        page = ViewPage(chromium)
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
    webdriver.ActionChains(page.browser).move_to_element(page.one("#frame")).perform()
    page.wait("document.querySelector('[data-fact=place]').textContent.endsWith('ball · clay')")
    assert page.fact("value").startswith("R 0.")
