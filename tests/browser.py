"""A real browser without a screen, controlled by its own driver; if there is none, tests that need it skip with the reason."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = (1024, 768)
PATIENCE = 60.0
"""Longest wait for content of a page, s; another process draws the pictures at low priority."""


@contextmanager
def browsing(*names: str, has_webgl: bool = False) -> Iterator[webdriver.Chrome]:
    """Yield a browser that reaches this computer alone, to which `names` lead too, or skip."""
    binary, driver = next(filter(None, map(shutil.which, BROWSERS)), None), shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("no Chromium with its driver here; Debian: apt-get install chromium chromium-driver")
    rules = "".join(f"MAP {name} 127.0.0.1, " for name in names)
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in (
        "--headless=new",
        "--no-sandbox",  # browsers refuse a sandbox to root
        "--disable-dev-shm-usage",
        "--enable-unsafe-swiftshader"
        if has_webgl
        else "--disable-3d-apis",  # without a graphics processor it takes much time
        "--disable-background-networking",
        f"--host-resolver-rules={rules}MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
        f"--window-size={SIZE[0]},{SIZE[1]}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=Service(driver))
    try:
        yield opened
    finally:
        opened.quit()


class PageView:
    """One tab that shows the page of a cell."""

    def __init__(self, opened: webdriver.Chrome, url: str) -> None:
        self._browser = opened
        opened.switch_to.new_window("tab")
        self._handle = opened.current_window_handle
        opened.get(url)

    def front(self) -> webdriver.Chrome:
        """Return the browser with this tab in front."""
        self._browser.switch_to.window(self._handle)
        return self._browser

    def text(self, name: str) -> str:
        """Return the text of an element as it is shown."""
        return self.front().find_element("id", name).text

    def press(self, ask: str) -> None:
        """Press one of the controls."""
        self.click("css selector", f"[data-ask={ask}]")

    def click(self, by: str, name: str) -> None:
        """Click an element in the middle of the view: the bar with Stop and Abort covers the end, which the driver scrolls to."""
        element = self.front().find_element(by, name)
        self._browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
        element.click()

    def is_enabled(self, ask: str) -> bool:
        """Return True if a control can be pressed."""
        button = self.front().find_element("css selector", f"[data-ask={ask}]")
        return button.get_attribute("aria-disabled") == "false"

    def until(self, is_met: Callable[[], bool]) -> None:
        """Wait until a condition holds."""
        WebDriverWait(self.front(), PATIENCE, 0.02).until(lambda _: is_met())

    def until_text(self, name: str, part: str) -> None:
        """Wait until an element shows a text."""
        try:
            self.until(lambda: part in self.text(name))
        except Exception as error:
            raise AssertionError(f"{name}: {self.text(name)!r} has no {part!r}") from error

    def script(self, source: str) -> object:
        """Return the result of a line of JavaScript in this tab."""
        return self.front().execute_script(source)

    def complaints(self) -> list[str]:
        """Return the messages of the browser's console since the last call."""
        found = [entry["message"] for entry in self.front().get_log("browser")]
        return [message for message in found if "GL Driver Message" not in message]  # how fast WebGL is here

    def close(self) -> None:
        """Close the tab."""
        self.front().close()
        self._browser.switch_to.window(self._browser.window_handles[0])
