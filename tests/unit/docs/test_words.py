"""Docstrings are sentences that stand on their own: what a test can see of that without reading."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGES = ("cell", "drivers", "plc_bridge", "sim", "skills")
FRAGMENTS = frozenset(
    (
        *("about", "above", "after", "along", "among", "as", "at", "before", "below", "between", "beyond", "beside"),
        *("by", "for", "from", "in", "like", "likewise", "of", "off", "on", "over", "since", "so"),
        *("than", "that", "through", "to", "toward", "towards", "under", "until", "upon", "which", "with", "within"),
        *("without"),
    )
)
"""Words that begin a fragment: its subject stands elsewhere, as in "Of the peg, rad."."""
UNITS = frozenset(("m", "m/s", "s", "rad", "rad/s", "kg", "N", "N/m", "N·m", "Pa", "Hz", "counts", "1/s"))
ENTRY = re.compile(r"^ {4,}(\w+): (.+)$", re.MULTILINE)
"""An entry of a list of arguments, errors or columns: a name, and what it is."""


def _fragments(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and text of every docstring that is a fragment, those below attributes and constants included."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for position, inner in enumerate(body if isinstance(body, list) else ()):
            if not (isinstance(inner, ast.Expr) and isinstance(inner.value, ast.Constant)):
                continue
            text = inner.value.value
            if isinstance(text, str):
                is_of_function = position == 0 and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
                words = text.split()
                if _begins_a_fragment(text) or (len(words) < 2 and not is_of_function):
                    yield inner.lineno, " ".join(words)
                for name, told in ENTRY.findall(text):
                    if _begins_a_fragment(told):
                        yield inner.lineno, f"{name}: {told}"


def _begins_a_fragment(text: str) -> bool:
    """Return whether a text lacks its subject, or is only a unit."""
    first = text.split()[0].strip(".,;:")
    return first.lower() in FRAGMENTS or first in UNITS


@pytest.mark.parametrize("package", PACKAGES)
def test_no_docstring_begins_with_a_preposition_or_is_but_a_unit(package):
    found = [
        f"{path}:{line}: {text}"
        for path in sorted(Path(package).rglob("*.py"))
        for line, text in _fragments(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert found == []


def test_an_argument_that_is_a_fragment_is_found():
    source = 'def go(speed, to):\n    """Go.\n\n    Args:\n        speed: m/s.\n        to: Of the tip, m.\n    """\n'
    assert [text for _, text in _fragments(ast.parse(source))] == ["speed: m/s.", "to: Of the tip, m."]


def test_a_fragment_is_found():
    source = 'def open():\n    """Connect."""\nWRIST = 1\n"""Of the arm, kg."""\nRATE = 2\n"""1/s."""\nMASS = 3\n"""Mass, kg."""\n'
    assert [text for _, text in _fragments(ast.parse(source))] == ["Of the arm, kg.", "1/s."]


@pytest.mark.parametrize("package", PACKAGES)
def test_whoever_catches_every_exception_says_why(package):
    silent = [
        f"{path}:{number}"
        for path in sorted(Path(package).rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.match(r"\s*except( (Base)?Exception( as \w+)?)?:(?!.*# \w)", line)
    ]
    assert silent == []
