"""A real Chromium that tests drive, and what they do with its pages."""

from __future__ import annotations

import shutil
import tempfile

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
SWITCHES = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)


@pytest.fixture(scope="session")
def chromium():
    """A Chromium that is driven by tests; they are skipped without it."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("needs chromium and chromedriver (apt-get install chromium chromium-driver)")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for switch in (*SWITCHES, f"--user-data-dir={profile}"):
            options.add_argument(switch)
        browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
        yield browser
        browser.quit()


class Page:
    """A page in the browser."""

    def __init__(self, browser):
        self.browser = browser

    def __call__(self, script, *arguments):
        """The value of an expression of JavaScript."""
        return self.browser.execute_script(f"return ({script})", *arguments)

    def one(self, selector):
        return self.browser.find_element("css selector", selector)

    def all(self, selector):
        return self.browser.find_elements("css selector", selector)

    def wait(self, script, *arguments):
        """Waits until an expression is true, and returns its value."""
        from selenium.webdriver.support.ui import WebDriverWait

        return WebDriverWait(self.browser, 20, 0.02).until(lambda _: self(script, *arguments), script)

    def settle(self):
        """Waits until the browser has laid out and drawn what has changed."""
        twice = "requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done)))"
        self.browser.execute_async_script(f"const done = arguments[0]; {twice}")

    def press(self, *names):
        """Presses keys where the focus is."""
        for name in names:
            self.browser.switch_to.active_element.send_keys(name)

    def set(self, selector, value):
        """Gives a control a value, as its user does."""
        self.browser.execute_script(
            "const field = document.querySelector(arguments[0]); field.value = arguments[1];"
            "for (const kind of ['input', 'change']) field.dispatchEvent(new Event(kind, {bubbles: true}))",
            selector,
            str(value),
        )
