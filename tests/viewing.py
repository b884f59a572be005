"""A server of the live view, and what tests do with its page."""

from __future__ import annotations

import threading
from contextlib import contextmanager

import pytest

from chromium import Page


@contextmanager
def running(viewer):
    """A server that runs in a thread."""
    thread = threading.Thread(target=viewer.run)
    thread.start()
    try:
        yield viewer
    finally:
        viewer.stop()
        thread.join()


@contextmanager
def served(path):
    """The server of a scene's page, which runs in a thread."""
    pytest.importorskip("websockets", reason="needs websockets")
    from illumcli.viewer.pictures import Renderer
    from illumcli.viewer.server import Viewer
    from illumcli.viewer.session import Session

    with running(Viewer(lambda send: Session(Renderer(path), send))) as viewer:
        yield viewer


def control(path, part):
    """Selector of a part of a control."""
    return f"[data-path='{path}'] {part}"


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

    def value(self, path, number=0):
        """The text of a number of a control."""
        return self(
            "document.querySelectorAll(arguments[0])[arguments[1]].value",
            control(path, "[type=number]"),
            number,
        )

    def open(self, group):
        """Opens a group of controls."""
        self.browser.execute_script(
            "document.querySelector(`details[data-group='${arguments[0]}']`).open = true", group
        )

    def fact(self, name):
        """A text of the line of state."""
        return self("document.querySelector(`[data-fact=${arguments[0]}]`).textContent", name)

    def point(self, selector, x=0, y=0):
        """Moves the mouse to a distance from the middle of an element."""
        from selenium import webdriver

        element = self.one(selector)
        return webdriver.ActionChains(self.browser).move_to_element_with_offset(element, x, y)

    def drag(self, selector, *, by, start=(0, 0)):
        """Presses the mouse at a distance from the middle of an element, moves it, and lets go."""
        from selenium import webdriver

        element = self.one(selector)
        actions = webdriver.ActionChains(self.browser, duration=30)
        actions.move_to_element_with_offset(element, *start).click_and_hold()
        actions.move_by_offset(*by).release().perform()
