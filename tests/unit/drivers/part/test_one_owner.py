"""Nobody but the part decides on its shape: no other module names a shape, a section's class or the word of a size."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[4]
PACKAGES = ("cell", "drivers", "plc_bridge", "sim", "skills")
OWNERS = {"drivers/part/shapes.py", "drivers/part/round.py", "drivers/part/rectangular.py", "drivers/parts.py"}
TABLES = {"skills/plan.py", "sim/contact/shapes.py", "cell/config/errors.py"}
"""They choose skills, contacts and models of the hole by the part's kind, or know a word of an older layout: as keys of a
table, and nowhere else."""
SHAPES = {"round", "square", "rectangular"}
CLASSES = {"Round", "Rectangular"}
SIZES = {"diameter", "sides"}


def modules() -> list[str]:
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return sorted(str(path.relative_to(ROOT)) for path in files)


def is_of_part(node: ast.expr) -> bool:
    """Return True if an expression is called peg, hole, bore or part."""
    name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
    return name.strip("_") in {"peg", "hole", "bore", "part"}


def decisions(source: str, may_key_tables: bool = False) -> list[str]:
    """Return the places in a module's source that decide on a part's shape."""
    tree, found = ast.parse(source), []
    keys = {
        id(key)
        for node in ast.walk(tree)
        for key in (node.keys if isinstance(node, ast.Dict) else node.elts if isinstance(node, ast.Set) else ())
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and node.value in SHAPES and not (may_key_tables and id(node) in keys):
            found.append(f"line {node.lineno}: {node.value!r}")
        elif isinstance(node, ast.Name) and node.id in CLASSES:
            found.append(f"line {node.lineno}: {node.id}")
        elif isinstance(node, ast.Attribute) and node.attr in SIZES and is_of_part(node.value):
            found.append(f"line {node.lineno}: .{node.attr} of a part")
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            asked = [s for s in sides if isinstance(s, ast.Attribute) and s.attr in {"shape", "kind"}]
            if any(is_of_part(side.value) for side in asked):
                found.append(f"line {node.lineno}: compares the shape or kind of a part")
    return found


def test_no_other_module_decides_by_shape() -> None:
    found = {
        module: decisions((ROOT / module).read_text(encoding="utf-8"), may_key_tables=module in TABLES)
        for module in modules()
        if module not in OWNERS
    }
    assert {module: lines for module, lines in found.items() if lines} == {}
