"""Docstrings are sentences that stand on their own: what a test can see of that without reading."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGES = ("cell", "config", "drivers", "plc_bridge", "sim", "skills")
FRAGMENTS = frozenset(
    (
        *("about", "above", "after", "along", "among", "as", "at", "before", "below", "between", "beyond", "beside"),
        *("by", "for", "from", "in", "like", "likewise", "of", "off", "on", "over", "since", "so"),
        *("than", "that", "through", "to", "toward", "towards", "under", "until", "upon", "which", "with", "within"),
        *("without"),
    )
)
"""Words that begin a fragment: its subject stands elsewhere, as in "Of the peg, rad."."""


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
                if words[0].strip(".,;:").lower() in FRAGMENTS or (len(words) < 2 and not is_of_function):
                    yield inner.lineno, " ".join(words)


@pytest.mark.parametrize("package", PACKAGES)
def test_no_docstring_begins_with_a_preposition_or_is_but_a_unit(package):
    found = [
        f"{path}:{line}: {text}"
        for path in sorted(Path(package).rglob("*.py"))
        for line, text in _fragments(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert found == []


def test_a_fragment_is_found():
    source = 'def open():\n    """Connect."""\nWRIST = 1\n"""Of the arm, kg."""\nRATE = 2\n"""1/s."""\nMASS = 3\n"""Mass, kg."""\n'
    assert [text for _, text in _fragments(ast.parse(source))] == ["Of the arm, kg.", "1/s."]
