"""A real browser without a screen, controlled by its own driver."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.errors import ConfigError

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = (1024, 768)
MISSING = "no Chromium with its driver and the package selenium here; Debian: apt-get install chromium chromium-driver"


def is_there() -> bool:
    """Return True if browser, driver and the driver's Python package are installed."""
    try:
        import selenium.webdriver  # noqa: F401
    except ImportError:
        return False
    return _browser() is not None and shutil.which("chromedriver") is not None


@contextmanager
def browsing(*names: str) -> "Iterator[Chrome]":
    """Yield a browser that reaches only this computer; `names` resolve to it too.

    Raises:
        ConfigError: There is no browser.
    """
    if not is_there():
        raise ConfigError(MISSING)
    from selenium.webdriver import Chrome
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    rules = "".join(f"MAP {name} 127.0.0.1, " for name in names)
    options = Options()
    options.binary_location = str(_browser())
    for argument in (
        "--headless=new",
        "--no-sandbox",  # browsers refuse a sandbox to root
        "--disable-dev-shm-usage",
        "--disable-background-networking",
        f"--host-resolver-rules={rules}MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
        f"--window-size={SIZE[0]},{SIZE[1]}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = Chrome(options=options, service=Service(shutil.which("chromedriver")))
    try:
        yield opened
    finally:
        opened.quit()


def memory_of(browser: "Chrome") -> float:
    """Return the memory of a browser and all its processes, bytes; shared pages are divided among the processes."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            continue
        children.setdefault(parent, []).append(int(folder.name))
    waiting, total = [int(browser.service.process.pid)], 0.0
    while waiting:
        process = waiting.pop()
        waiting += children.get(process, [])
        total += _proportional(process)
    return total


def _proportional(process: int) -> float:
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(1024.0 * float(line.split()[1]) for line in lines if line.startswith("Pss:"))


def _browser() -> str | None:
    return next(filter(None, map(shutil.which, BROWSERS)), None)
