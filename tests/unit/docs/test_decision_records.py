"""The decision records and their index, held against each other."""

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "decisions"
RECORDS = sorted(FOLDER.glob("[0-9]*.md"))
SECTIONS = ("Context", "Decision", "Consequences", "Learnt", "Tried", "Tried and dropped")


def test_index_lists_every_record_with_its_title():
    index = (FOLDER / "README.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| \[(\d{4})\]\((.+?)\) \| (.+) \|$", index, re.M)
    titles = [path.read_text(encoding="utf-8").partition("\n")[0] for path in RECORDS]
    assert [(file, f"# {number}. {title}") for number, file, title in listed] == [
        (path.name, title) for path, title in zip(RECORDS, titles, strict=True)
    ]


def test_numbers_run_from_one_without_gap_or_double():
    assert [path.name[:4] for path in RECORDS] == [f"{n:04d}" for n in range(1, len(RECORDS) + 1)]


@pytest.mark.parametrize("path", RECORDS, ids=lambda path: path.name)
def test_record_has_its_form(path: Path):
    text = path.read_text(encoding="utf-8")
    sections = re.findall(r"^## (.+)$", text, re.M)
    assert re.fullmatch(r"\d{4}-[a-z0-9-]+\.md", path.name)
    assert re.search(r"^- Date: \d{4}-\d\d-\d\d$", text, re.M)
    assert sections[:2] == ["Context", "Decision"]
    assert set(sections) <= set(SECTIONS)
