"""The table of `docs/extend.md` lists the files that name an existing thing of each kind."""

import re
from pathlib import Path

import pytest

from tests.unit.docs.test_sizes import sources

PAGE = Path("docs/extend.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (?P<what>[^|]+) \| (?P<new>[^|]+) \| (?P<touched>[^|]+) \|$", re.MULTILINE)
SETTINGS = "pyproject.toml"


def _row(what: str) -> tuple[str, set[str]]:
    """Return the count of existing files that a row states, and the files that it names."""
    (touched,) = (found["touched"] for found in ROW.finditer(PAGE) if found["what"].strip() == what)
    return touched.partition(":")[0].strip(), set(re.findall(r"`([\w/]+\.\w+)`", touched.partition(", which")[0]))


def _naming(pattern: str, own: str) -> set[str]:
    """Return the files that name a thing, apart from its own and those of the laboratory's studies."""
    files = {**sources(), SETTINGS: Path(SETTINGS).read_text(encoding="utf-8")}
    return {
        name
        for name, text in files.items()
        if re.search(pattern, text) and not name.startswith(own) and not re.match(r"cell/lab/\w+/", name)
    }


@pytest.mark.parametrize(
    ("what", "pattern", "own"),
    [
        ("an estimator", r"\bskills\.tactile\.image\b", "skills/tactile/image"),
        ("a command", r"\"faults\": \"", "cell/commands/faults"),
        ("an arm with another interface", r"\bdrivers\.arm\.franka\b|\bFrankaArmConfig\b", "drivers/arm/"),
        ("a page that shows live theta", r"\bcell\.page\b", "cell/page/"),
        ("a peg with another kind of cross-section", r"\bRectangular\b|\"rectangular\": ", "drivers/part/rectangular"),
    ],
)
def test_the_page_lists_the_files_to_touch(what, pattern, own):
    count, stated = _row(what)
    assert stated == _naming(pattern, own)
    assert count == str(len(stated))


def test_a_skill_that_moves_needs_nine_names_of_this_project():
    (code,) = re.findall(r"```python skills/lift\.py\n(.+?)```", PAGE, re.DOTALL)
    names = [
        name for line in re.findall(r"^from skills\.\w+ import (.+)$", code, re.MULTILINE) for name in line.split(", ")
    ]
    assert "move" in names
    assert len({*names, "Skill"}) == 9


def test_a_study_touches_the_list_of_studies():
    count, stated = _row("a study")
    assert stated == {"cell/lab/commands/study.py"}
    assert stated == {name for name, text in sources().items() if re.search(r"cell\.lab\.stability\b", text)}
    assert count == "1"
