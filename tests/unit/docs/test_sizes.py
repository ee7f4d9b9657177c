"""Long and complex functions have a reason beside their name."""

import ast
from functools import cache

from tests.pages import PACKAGES, ROOT

MOST = 60
"""Lines of a function without its docstring."""


@cache
def sources() -> dict[str, str]:
    """Return the text of every module of the program by its path."""
    files = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in files}


@cache
def trees() -> dict[str, ast.Module]:
    """Return the syntax tree of every module of the program by its path."""
    return {path: ast.parse(text) for path, text in sources().items()}


def _lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    first = node.body[0]
    has_docstring = isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str)
    docstring = first.end_lineno - first.lineno + 1 if has_docstring else 0
    return node.end_lineno - node.lineno + 1 - docstring


def _has_reason(line: str) -> bool:
    return len(line.partition("# noqa:")[2].partition("  ")[2].split()) >= 4


def test_a_function_of_more_than_sixty_lines_has_a_reason():
    long = [
        (f"{path}:{node.lineno}: {node.name}: {_lines(node)} lines", sources()[path].splitlines()[node.lineno - 1])
        for path, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and _lines(node) > MOST
    ]
    assert [name for name, line in long if not _has_reason(line)] == []


def test_an_excused_complexity_has_a_reason():
    lines = [f"{path}: {line}" for path, text in sources().items() for line in text.splitlines() if "C901" in line]
    assert [line for line in lines if "# noqa" in line and not _has_reason(line)] == []
