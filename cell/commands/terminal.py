"""Output and progress of commands; the only module that writes to the terminal."""

import argparse
import json
import select
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.progress import Progress
    from rich.table import Table

GOOD, NOT_GOOD, WRONG_USE, FAULT = 0, 1, 2, 3
"""Exit status: success, no success, wrong use, fault."""
PATIENCE = 1.0
"""Longest wait for the reader of standard error, s."""
PIPE_WIDTH = 200
"""Width of tables in a pipe, characters; at the default width of 80 they would lose content."""


def show(args: argparse.Namespace, picture: "RenderableType", data: object, status: int = GOOD) -> int:
    """Print a result at once: with --json `data`, else `picture`, each part of a group in turn.

    With --sql, the queries are already printed. Return the exit status of the command.
    """
    if getattr(args, "sql", False):
        return status
    if args.json:
        print(json.dumps(data, indent=2), flush=True)
    else:
        from rich.console import Group

        terminal = console(None if sys.stdout.isatty() else PIPE_WIDTH)
        for part in picture.renderables if isinstance(picture, Group) else (picture,):
            # Plain text is not wrapped, so that a line for a config file can be copied whole.
            terminal.print(_folded(part), soft_wrap=isinstance(part, str))
            sys.stdout.flush()  # the next part may take time
    return status


def filled(head: Sequence[str], rows: Iterable[Sequence[str | None]], **options: Any) -> "Table":
    """Return a table with these rows; `options` are those of `rich.table.Table`."""
    from rich.table import Table

    table = Table(*head, **options)
    for row in rows:
        table.add_row(*row)
    return table


def _folded(part: "RenderableType") -> "RenderableType":
    """Return a part of a picture; on a narrow terminal, a table folds its long cells instead of cutting them."""
    from rich.table import Table

    for column in part.columns if isinstance(part, Table) else ():
        column.overflow = "fold"
    return part


def say(*words: object) -> None:
    """Print one line in addition to the result, at once."""
    print(*words, flush=True)


def complain(message: str, status: int = NOT_GOOD) -> int:
    """Print one line about an error on standard error, after the program's name; return the exit status of such an error.

    The line is skipped if standard error has no reader.
    """
    with suppress(OSError):
        if _is_read(sys.stderr):
            print(f"cell: {message}".replace("\n", " "), file=sys.stderr)
    return status


def _is_read(stream: TextIO) -> bool:
    """Wait up to `PATIENCE` until a stream is writable; return False for a full pipe without a reader."""
    try:
        return bool(select.select([], [stream], [], PATIENCE)[1])
    except (OSError, ValueError):
        return True  # neither pipe nor file, for example a test's buffer


def ask(text: str) -> None:
    """Print a request to the person at the terminal and wait for Enter; standard output stays free for results."""
    print(f"\n{text}", end="", file=sys.stderr, flush=True)
    input()


def written(args: argparse.Namespace, files: Iterable[Path]) -> None:
    """Print the names of the files that a command has written, unless its result is JSON or SQL."""
    files = list(files)
    if files and not args.json and not getattr(args, "sql", False):
        say("written:", *files)


def console(width: int | None = None, is_error: bool = False) -> "Console":
    """Return the terminal's console without markup: serial numbers and names from outside may look like markup."""
    from rich.console import Console

    return Console(width=width, stderr=is_error, markup=False, emoji=False)


@contextmanager
def counting(name: str) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar; yield a function that sets the number of steps done and of all steps."""
    with progress() as bars:
        bar = bars.add_task(name, total=None)
        yield lambda done, of: bars.update(bar, completed=done, total=of)


def progress() -> "Progress":
    """Return progress bars on standard error; they are disabled if it is not a terminal."""
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
