"""The pages for people: their links lead somewhere, their commands and files exist, the README stays short."""

import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

from cell.commands.cli import COMMANDS
from cell.config.load import load
from tests.pages import PAGES, REASONS, ROOT, Block, blocks, without_blocks

LINK = re.compile(r"(?<!\\)\[[^\]]*\]\(([^)\s]+)\)|^\[[^\]]+\]: (\S+)", re.M)
FILE = re.compile(r"`([\w./-]+/[\w.-]+\.(?:py|toml|md|png|hex|c))`")
COMMAND = re.compile(r"`(?:\.venv/bin/)?cell ([a-z]+)")
README_WORDS = 700
RELEASE_LINES = 25
"""Most entries of a release in the changelog."""


@cache
def anchors(path: Path) -> set[str]:
    """Return the anchors that a page's headings get."""
    headings = re.findall(r"^#+ (.+)$", without_blocks(path), re.M)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_to_a_file_and_a_heading(page):
    broken = []
    for target in (inline or reference for inline, reference in LINK.findall(without_blocks(page))):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        if not there.is_file() or (anchor and anchor not in anchors(there)):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.parent.name != "decisions"], ids=lambda page: str(page.relative_to(ROOT))
)
def test_every_file_and_command_that_is_named_exists(page):
    text = without_blocks(page)
    if page.name != "CHANGELOG.md":
        assert [name for name in FILE.findall(text) if not list(ROOT.glob(name.replace("N.toml", "*.toml")))] == []
    assert sorted(set(COMMAND.findall(text)) - set(COMMANDS)) == []


@pytest.mark.parametrize("block", blocks(), ids=str)
def test_every_fenced_block_says_what_it_is(block: Block):
    kind, _, note = block.info.partition(" ")
    assert kind in ("console", "toml", "python", "st", "text", "yaml"), (
        f"{block}: console, toml, python, st, text or yaml allowed"
    )
    if kind == "console":
        assert note == "" or note in REASONS, f"{block}: nothing, so that it is run, or one of {', '.join(REASONS)}"
    if kind == "python":
        assert (ROOT / note).parent.is_dir(), f"{block}: the file that it stands in"


@pytest.mark.parametrize("block", [block for block in blocks() if block.info.startswith("toml")], ids=str)
def test_every_piece_of_config_can_be_used(block: Block, tmp_path):
    named = block.info.partition(" ")[2]
    shipped = tomllib.loads((ROOT / "config" / f"{named or 'sim'}.toml").read_text(encoding="utf-8"))
    # A base gives all but limits and places, and has no base itself.
    own = {"base": "sim.toml", **{name: shipped[name] for name in ("limits", "hole", "rack")}}
    own["hole"] = {key: shipped["hole"][key] for key in ("centre", "area")}
    cell = shipped if named else own
    for name, section in tomllib.loads(block.text).items():
        cell[name] = {**cell.get(name, {}), **section}
    file = tmp_path / "cell.toml"
    file.write_text(_as_toml(cell), encoding="utf-8")
    load(file)


def _as_toml(cell: dict[str, object]) -> str:
    """Return nested tables of plain values as TOML."""

    def value(item: object) -> str:
        if isinstance(item, dict):
            return "{ " + ", ".join(f"{key} = {value(part)}" for key, part in item.items()) + " }"
        if isinstance(item, list):
            return "[" + ", ".join(value(part) for part in item) + "]"
        return {True: "true", False: "false"}.get(item, repr(item)) if isinstance(item, bool) else repr(item)

    return "\n".join(f"{key} = {value(item)}" for key, item in cell.items())


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) < README_WORDS


def test_ci_runs_the_readmes_second_command_then_faults_then_speed():
    (commands,) = [block for block in blocks() if block.page.name == "README.md"]
    demo, tests = commands.text.strip().splitlines()
    assert demo.endswith(".venv/bin/cell demo")
    run = [line for line in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    at = run.index(tests)
    assert (run[at - 1], run[at + 1]) == ("(", ")")
    assert [line for line in run if line][-2:] == [
        ".venv/bin/cell study faults --quick --seed 142001 --out build/faults",
        ".venv/bin/python -m pytest tests/bench",
    ]


def test_no_command_of_ci_fails_unseen_before_another():
    """Bash's -e ignores a command that fails before &&, but not a subshell that fails."""
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    joined = [n for n, line in enumerate(lines) if " && " in line and not re.match(r"\s*(#|\(|if )", line)]
    assert [lines[n - 1] for n in joined] == ["("]


def test_the_changelog_has_its_form():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = re.findall(r"^## (.+)$", text, re.M)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    dated = [re.fullmatch(r"\[(\d+\.\d+\.\d+)\] - \d{4}-\d\d-\d\d", version) for version in versions[1:]]
    assert versions[0] == "[Unreleased]"
    assert all(dated)
    assert project["version"] in [version[1] for version in dated if version]
    assert max(release.count("\n- ") for release in text.split("\n## ")) <= RELEASE_LINES
    assert set(re.findall(r"^### (.+)$", text, re.M)) <= {
        "Added",
        "Changed",
        "Deprecated",
        "Removed",
        "Fixed",
        "Security",
    }
