"""Every picture of the documents says what drew it, of which code."""

import re

import pytest

from cell.cli import COMMANDS
from tests.pictures import FOLDER, ROOT, commits_since, pictures


def test_every_picture_is_in_the_table_and_nothing_else():
    assert sorted(picture.name for picture in pictures()) == sorted(path.name for path in FOLDER.glob("*.png"))


@pytest.mark.parametrize("picture", pictures(), ids=lambda picture: picture.name)
def test_a_picture_names_a_command_a_commit_and_what_it_shows(picture):
    program, command, *_ = picture.command.split()
    assert program == "cell"
    assert command in COMMANDS
    assert re.fullmatch(r"[0-9a-f]{7,40}", picture.commit)
    assert picture.shows
    assert [name for name in picture.shows if not (ROOT / name).exists()] == []


def test_a_picture_is_old_where_what_it_shows_was_changed():
    (chain,) = (picture for picture in pictures() if picture.name == "chain.png")
    try:
        since = commits_since(chain)
    except (RuntimeError, OSError):
        pytest.skip("git does not know the commit: no history is here")
    assert all(re.match(r"[0-9a-f]{7,} \S", line) for line in since)
