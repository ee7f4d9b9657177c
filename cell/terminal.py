"""What a command prints, and the progress that it shows; the only place that writes to the terminal."""

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.progress import Progress

GOOD, NOT_GOOD, WRONG_USE, FAULT = 0, 1, 2, 3
"""Exit statuses: done and good, done and not good, wrong use, fault."""
PIPE_WIDTH = 200
"""A pipe has no width; a table cut to that of a terminal would lose what it says, characters."""


def show(args: argparse.Namespace, picture: "RenderableType", data: object) -> None:
    """Print a result: `picture` for people, or with --json `data` for programs."""
    if args.json:
        print(json.dumps(data, indent=2))
    else:
        console(None if sys.stdout.isatty() else PIPE_WIDTH).print(picture)


def say(*words: object) -> None:
    """Print one line beside the result, at once."""
    print(*words, flush=True)


def complain(message: str) -> None:
    """Print one line of what is wrong on standard error, and say who says it."""
    print(f"cell: {message}".replace("\n", " "), file=sys.stderr)


def ask(text: str) -> None:
    """Wait until somebody at the terminal has done something and presses Enter; standard output is for results."""
    print(f"\n{text}", end="", file=sys.stderr, flush=True)
    input()


def written(args: argparse.Namespace, files: Iterable[Path]) -> None:
    """Name the files that a command has written, unless its result is JSON."""
    files = list(files)
    if files and not args.json:
        say("written:", *files)


def console(width: int | None = None, is_error: bool = False) -> "Console":
    """Return the terminal, which takes no text for markup: serial numbers and names come from outside."""
    from rich.console import Console

    return Console(width=width, stderr=is_error, markup=False, emoji=False)


def progress() -> "Progress":
    """Return bars on a terminal, nothing in a pipe."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console(is_error=True), disable=not sys.stderr.isatty())
