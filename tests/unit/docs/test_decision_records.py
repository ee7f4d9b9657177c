"""The decision records and their index, held against each other."""

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "decisions"
STATUS = re.compile(r"accepted|superseded (?:in part )?by (?P<successor>\d{4})")
SECTIONS = ("Context", "Decision", "Consequences", "Learnt", "Tried", "Tried and dropped")


@dataclass(frozen=True)
class Listed:
    """Number, title and state of a decision, in its record or in its line of the index."""

    file: str
    title: str
    status: str


def record(path: Path) -> Listed:
    title, blank, status = path.read_text(encoding="utf-8").splitlines()[:3]
    assert title.startswith(f"# {path.name[:4]}. "), f"{path.name}: the title is '# {path.name[:4]}. TITLE'"
    assert blank == ""
    assert status.startswith("- Status: "), f"{path.name}: the third line is '- Status: STATUS'"
    return Listed(path.name, title.removeprefix(f"# {path.name[:4]}. "), status.removeprefix("- Status: "))


def records() -> list[Path]:
    return sorted(path for path in FOLDER.glob("*.md") if path.name != "README.md")


def test_index_lists_every_record_with_its_title_and_status():
    index = [
        Listed(file, title, status)
        for number, file, title, status in re.findall(
            r"^\| \[(\d{4})\]\((.+?)\) \| (.+) \| (.+) \|$", (FOLDER / "README.md").read_text(encoding="utf-8"), re.M
        )
        if file.startswith(number)
    ]

    assert index == [record(path) for path in records()]


def test_numbers_run_from_one_without_gap_or_double():
    assert [path.name[:4] for path in records()] == [f"{n:04d}" for n in range(1, len(records()) + 1)]


@pytest.mark.parametrize("path", records(), ids=lambda path: path.name)
def test_record_has_the_form_that_the_index_asks_for(path: Path):
    status = STATUS.fullmatch(record(path).status)
    text = path.read_text(encoding="utf-8")
    sections = re.findall(r"^## (.+)$", text, re.M)

    assert re.fullmatch(r"\d{4}-[a-z0-9-]+\.md", path.name)
    assert re.search(r"^- Date: \d{4}-\d\d-\d\d$", text, re.M)
    assert sections[:2] == ["Context", "Decision"]
    assert set(sections) <= set(SECTIONS)
    assert status is not None, f"{path.name}: accepted, superseded by NNNN, or superseded in part by NNNN"
    if successor := status["successor"]:
        assert successor > path.name[:4]
        assert list(FOLDER.glob(f"{successor}-*.md"))
