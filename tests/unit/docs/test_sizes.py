"""Functions are short enough to be read at once, and those that are not say why beside them."""

import ast
from pathlib import Path

import pytest

PACKAGES = ("cell", "drivers", "plc_bridge", "sim", "skills")
MOST = 60
"""Lines of a function without its docstring."""


def _lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    first = node.body[0]
    has_docstring = isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str)
    docstring = first.end_lineno - first.lineno + 1 if has_docstring else 0
    return node.end_lineno - node.lineno + 1 - docstring


@pytest.mark.parametrize("package", PACKAGES)
def test_a_function_of_more_than_sixty_lines_says_why_beside_its_name(package):
    found = []
    for path in sorted(Path(package).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and _lines(node) > MOST:
                reason = lines[node.lineno - 1].partition("# noqa:")[2].partition("  ")[2]
                if len(reason.split()) < 4:
                    found.append(f"{path}:{node.lineno}: {node.name}: {_lines(node)} lines")
    assert found == []


def test_no_complexity_is_excused_without_a_reason():
    """The linter refuses a complexity over ten; an exception to it carries its reason in the same comment."""
    for path in sorted(each for package in PACKAGES for each in Path(package).rglob("*.py")):
        for line in path.read_text(encoding="utf-8").splitlines():
            if "# noqa" in line and "C901" in line:
                assert len(line.partition("# noqa:")[2].partition("  ")[2].split()) >= 4, f"{path}: {line}"
