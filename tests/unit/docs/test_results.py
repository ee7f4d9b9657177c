"""The page of results is what its data say, and every claim names its command, commit and code."""

import re
from dataclasses import replace

import pytest

from cell.commands.cli import COMMANDS
from tests.results import PAGE, ROOT, commits_since, data, page, printed

WORDS = 2500
ROWS = printed(data())


def test_the_page_is_generated_from_its_data():
    assert PAGE.read_text(encoding="utf-8") == page(data()), "run: python -m tests.results"


def test_the_page_is_short():
    assert len(PAGE.read_text(encoding="utf-8").split()) <= WORDS


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_claim_names_a_command_a_commit_and_code_that_exists(row):
    words = row.command.split()
    assert words[0] != "cell" or words[1] in COMMANDS
    assert re.fullmatch(r"[0-9a-f]{7,40}", row.commit)
    assert row.depends
    assert [name for name in row.depends if not (ROOT / name).exists()] == []


def test_the_data_list_every_picture_of_the_documents():
    listed = {row.name for row in ROWS if row.name.endswith(".png")}
    assert listed == {path.name for path in (ROOT / "docs" / "pictures").glob("*.png")}


def test_a_claim_is_old_if_its_code_changed_after_its_commit():
    row = replace(ROWS[0], commit="6df4a0f", depends=("docs/results.md",))
    try:
        since = commits_since(row)
    except (RuntimeError, OSError):
        pytest.skip("git does not know the commit: no history is here")
    assert since
    assert all(re.match(r"[0-9a-f]{7,} \S", line) for line in since)
