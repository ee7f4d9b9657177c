"""The pages for people, and the fenced blocks in them."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("cell", "drivers", "plc_bridge", "sim", "skills")
PAGES = sorted([ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")])
REASONS = {
    "hardware": "needs a device that is not here",
    "install": "installs packages, or needs some that are installed by hand",
    "long": "takes longer than a test may",
    "network": "needs another computer",
    "serves": "goes on until somebody stops it",
    "after-the-edit": "works once the edit above it is made",
}
"""Reason why a block of commands is not run by itself: its info string."""
RENDERING = "rendering"
"""A block of commands with this word is run where pictures can be rendered, and skipped elsewhere."""
REASONS[RENDERING] = "needs OpenGL"
_BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.M | re.S)


@dataclass(frozen=True)
class Block:
    """One fenced block."""

    page: Path
    number: int
    info: str
    """What stands behind the fence: the kind of text, and a note."""
    text: str

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}-{self.number}"


@cache
def blocks() -> list[Block]:
    """Return all fenced blocks of all pages."""
    return [
        Block(page, number, info.strip(), text)
        for page in PAGES
        for number, (info, text) in enumerate(_BLOCK.findall(page.read_text(encoding="utf-8")), 1)
    ]


def without_blocks(page: Path) -> str:
    """Return a page's text without its fenced blocks."""
    return _BLOCK.sub("", page.read_text(encoding="utf-8"))
