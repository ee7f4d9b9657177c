"""What a command prints, and the progress that it shows; the only place that writes to the terminal."""

import argparse
import json
import select
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.progress import Progress

GOOD, NOT_GOOD, WRONG_USE, FAULT = 0, 1, 2, 3
"""Exit statuses: done and good, done and not good, wrong use, fault."""
PATIENCE = 1.0
"""Longest wait for a reader of a line on standard error, s."""
PIPE_WIDTH = 200
"""Width of tables in a pipe, characters; cut to a terminal's width they would lose content."""


def show(args: argparse.Namespace, picture: "RenderableType", data: object) -> None:
    """Print a result at once: `picture` for people, a group part by part, or with --json `data` for programs."""
    if args.json:
        print(json.dumps(data, indent=2))
    else:
        from rich.console import Group

        terminal = console(None if sys.stdout.isatty() else PIPE_WIDTH)
        for part in picture.renderables if isinstance(picture, Group) else (picture,):
            terminal.print(_folded(part))
            sys.stdout.flush()
    sys.stdout.flush()  # what follows may take time


def _folded(part: "RenderableType") -> "RenderableType":
    """Return a part of a picture, which as a table folds what does not fit a narrow terminal: nothing is cut."""
    from rich.table import Table

    for column in part.columns if isinstance(part, Table) else ():
        column.overflow = "fold"
    return part


def say(*words: object) -> None:
    """Print one line beside the result, at once."""
    print(*words, flush=True)


def complain(message: str) -> None:
    """Print one line on standard error that says what is wrong, after the program's name; not where nobody reads what is printed."""
    with suppress(OSError):
        if _is_read(sys.stderr):
            print(f"cell: {message}".replace("\n", " "), file=sys.stderr)


def _is_read(stream: TextIO) -> bool:
    """Wait a moment until a stream takes a line, and return whether it does: a pipe that is full and that nobody reads never will."""
    try:
        return bool(select.select([], [stream], [], PATIENCE)[1])
    except (OSError, ValueError):
        return True  # no pipe and no file, as where a test reads it


def ask(text: str) -> None:
    """Ask somebody at the terminal to do something and wait for Enter; standard output is left to results."""
    print(f"\n{text}", end="", file=sys.stderr, flush=True)
    input()


def written(args: argparse.Namespace, files: Iterable[Path]) -> None:
    """Name the files that a command has written, unless its result is JSON."""
    files = list(files)
    if files and not args.json:
        say("written:", *files)


def console(width: int | None = None, is_error: bool = False) -> "Console":
    """Return the terminal's console, which treats no text as markup, because serial numbers and names come from outside."""
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
