"""Every physical figure of the skills states its unit and its source."""

import ast
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

import skills

UNIT = re.compile(r",? (?:m|s|N|rad|kg|m/s|rad/s|1/s|N·m|N/m|m/N|kg·m²|N·m/\(rad·s\)|counts)(?=[,.;:) ]|$)")
SOURCE = re.compile(r"Source: \S|assumed|[Cc]hosen|measured by|derived|decision \d|docs/|config/|\[[a-z]+\]|`cell ")


def figures() -> Iterator[tuple[str, str]]:
    """Yield name and docstring of each constant of the skills with a floating-point number and a unit."""
    for path in sorted(Path(skills.__file__).parent.rglob("*.py")):
        module = ast.parse(path.read_text(encoding="utf-8"))
        for body in (module.body, *(each.body for each in module.body if isinstance(each, ast.ClassDef))):
            for above, below in pairwise(body):
                if isinstance(above, ast.Assign) and isinstance(below, ast.Expr):
                    name, text = ast.unparse(above.targets[0]), " ".join(ast.unparse(below).split())
                    is_number = any(isinstance(getattr(part, "value", None), float) for part in ast.walk(above.value))
                    if name.isupper() and is_number and UNIT.search(text):
                        yield f"{path.stem}.{name}", text


@pytest.mark.parametrize(("name", "text"), list(figures()), ids=lambda text: text.split()[0])
def test_a_physical_figure_states_its_source(name, text):
    assert SOURCE.search(text), name
