"""Which pictures of the documents are older than the code that they show.

    python -m tests.pictures

prints for every picture how many commits have changed since what it shows, and ends with status 1 where any has. The
table is `docs/pictures/drawn.toml`; git has to know the commits.
"""

import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "pictures"


@dataclass(frozen=True)
class Picture:
    """What drew one picture."""

    name: str
    command: str
    commit: str
    shows: tuple[str, ...]


def pictures() -> list[Picture]:
    """Return the table of the pictures."""
    table = tomllib.loads((FOLDER / "drawn.toml").read_text(encoding="utf-8"))
    return [Picture(name, row["command"], row["commit"], tuple(row["shows"])) for name, row in table.items()]


def commits_since(picture: Picture) -> list[str]:
    """Return the commits that have changed what a picture shows since it was drawn, newest first.

    Raises:
        RuntimeError: Git does not know the commit, or is not there.
    """
    words = ["git", "-C", str(ROOT), "log", "--format=%h %s", f"{picture.commit}..HEAD", "--", *picture.shows]
    told = subprocess.run(words, capture_output=True, text=True, check=False)
    if told.returncode:
        raise RuntimeError(f"{picture.name}: {told.stderr.strip()}")
    return told.stdout.splitlines()


def main() -> int:
    """Print the table."""
    stale = 0
    for picture in pictures():
        since = commits_since(picture)
        stale += bool(since)
        sys.stdout.write(f"{picture.name:28} {picture.commit}  {len(since):3} commits since  {picture.command}\n")
    return int(stale > 0)


if __name__ == "__main__":
    sys.exit(main())
