"""Sizes of the project: lines by part, words of the documents, complexity, and words that the style forbids.

    python -m tests.sizes [FOLDER]
    python -m tests.sizes --budgets > tests/budgets.toml

The first prints them for a checkout, this one by default; compare two checkouts by running it on both. The second writes the
lines of each room as its budget, which a test holds; a commit that raises one states what a user gets for it.
"""

import argparse
import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

PRODUCT = ("cell", "drivers", "plc_bridge", "sim", "skills")
LABORATORY = Path("cell/lab")
SPEAKING = re.compile(r"\b(tells?|told|telling|says?|said|saying)\b", re.I)
NOMINAL = re.compile(r"\bwhat (is|was|the|a|an|it|they|has|had)\b", re.I)
STEP = 25
"""Steps of a budget, lines."""
BRANCHES = (ast.If, ast.For, ast.While, ast.ExceptHandler, ast.IfExp, ast.match_case)


def files(root: Path, *folders: str) -> list[Path]:
    """Return the Python files of these folders."""
    return [path for folder in folders for path in sorted((root / folder).rglob("*.py"))]


def prose(path: Path) -> Iterator[str]:
    """Yield docstrings and comments of a file."""
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value
    yield from (
        token.string for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type == tokenize.COMMENT
    )


def complexity(function: ast.AST) -> int:
    """Return 1 + the branches of a function, those of boolean operators and comprehensions included."""
    found = 1
    for node in ast.walk(function):
        if isinstance(node, ast.BoolOp):
            found += len(node.values) - 1
        elif isinstance(node, ast.comprehension):
            found += 1 + len(node.ifs)
        else:
            found += isinstance(node, BRANCHES)
    return found


def over_ten(path: Path) -> int:
    """Return the number of functions whose complexity exceeds 10."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return sum(
        isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and complexity(node) > 10 for node in ast.walk(tree)
    )


def lines(paths: list[Path]) -> int:
    """Return the number of lines of files."""
    return sum(path.read_text(encoding="utf-8").count("\n") for path in paths)


def rooms(root: Path) -> dict[str, int]:
    """Return the lines of each folder of the product, the laboratory and the tests, its files alone."""
    folders = {path.parent.relative_to(root) for path in files(root, *PRODUCT, "tests")}
    return {folder.as_posix(): lines(sorted((root / folder).glob("*.py"))) for folder in sorted(folders)}


def budgets(root: Path) -> str:
    """Return the lines of each room, rounded up to the next step, as TOML."""
    return "".join(f'"{room}" = {-(-count // STEP) * STEP}\n' for room, count in rooms(root).items())


def main(root: Path) -> None:
    """Print the sizes of a checkout."""
    code = files(root, *PRODUCT)
    laboratory = [path for path in code if LABORATORY in path.relative_to(root).parents]
    product = [path for path in code if path not in set(laboratory)]
    pages = [path for path in root.rglob("*.md") if not {".venv", "build"} & set(path.relative_to(root).parts)]
    words = {path.relative_to(root).as_posix(): len(path.read_text(encoding="utf-8").split()) for path in pages}
    text = " ".join(part for path in code for part in prose(path))
    spoken = len(text.split()) / 1000.0
    constants = sum(
        isinstance(node, ast.Assign | ast.AnnAssign)
        and all(
            isinstance(target, ast.Name) and target.id.isupper()
            for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        )
        for path in code
        for node in ast.parse(path.read_text(encoding="utf-8")).body
    )
    figures = {
        "product lines, without laboratory": lines(product),
        "skills/ lines": lines(files(root, "skills")),
        "laboratory lines": lines(laboratory),
        "test lines": lines(files(root, "tests")),
        "decision records": len([name for name in words if re.match(r"docs/decisions/\d", name)]),
        "words of Markdown but the README": sum(words.values()) - words.get("README.md", 0),
        "words of the README": words.get("README.md", 0),
        "functions over complexity 10": sum(map(over_ten, code)),
        "module constants per 1,000 lines": round(1000 * constants / lines(code), 1),
        "tell, say per 1,000 words of docstrings and comments": round(len(SPEAKING.findall(text)) / spoken, 2),
        '"what is ..." per 1,000 words': round(len(NOMINAL.findall(text)) / spoken, 2),
    }
    for name, value in figures.items():
        sys.stdout.write(f"{name:56} {value:>9}\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path(__file__).parents[1], help="a checkout; default this"
    )
    parser.add_argument("--budgets", action="store_true", help="print the budget of each room")
    asked = parser.parse_args()
    if not files(asked.folder, *PRODUCT):
        parser.error(f"{asked.folder}: no {', '.join(PRODUCT)} there; a checkout allowed")
    if asked.budgets:
        sys.stdout.write(budgets(asked.folder))
    else:
        main(asked.folder)
