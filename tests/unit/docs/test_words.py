"""Docstrings begin with a subject, and a caught `Exception` has a reason."""

import ast
import re
from collections.abc import Iterator

import pytest

from tests.unit.docs.test_sizes import sources, trees

FRAGMENTS = frozenset(
    (
        *("about", "above", "after", "along", "among", "as", "at", "before", "below", "between", "beyond", "beside"),
        *("by", "for", "from", "in", "like", "likewise", "of", "off", "on", "over", "since", "so", "than", "that"),
        *("through", "to", "toward", "towards", "under", "until", "upon", "which", "with", "within", "without"),
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


def test_no_docstring_begins_with_a_preposition_or_is_a_unit():
    found = [f"{path}:{line}: {text}" for path, tree in trees().items() for line, text in _fragments(tree)]
    assert found == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        (
            'def go(speed, to):\n    """Go.\n\n    Args:\n        speed: m/s.\n        to: Of the tip, m.\n    """\n',
            ["speed: m/s.", "to: Of the tip, m."],
        ),
        (
            'def open():\n    """Connect."""\nWRIST = 1\n"""Of the arm, kg."""\nRATE = 2\n"""1/s."""\nMASS = 3\n"""Mass, kg."""\n',
            ["Of the arm, kg.", "1/s."],
        ),
    ],
)
def test_a_fragment_is_found(source, found):
    assert [text for _, text in _fragments(ast.parse(source))] == found


def test_a_caught_exception_of_every_kind_has_a_reason():
    silent = [
        f"{path}:{number}"
        for path, text in sources().items()
        for number, line in enumerate(text.splitlines(), 1)
        if re.match(r"\s*except( (Base)?Exception( as \w+)?)?:(?!.*# \w)", line)
    ]
    assert silent == []
