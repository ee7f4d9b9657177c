"""Trouble with the disk, and waits for the actions of other threads."""

import resource
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

Answer = TypeVar("Answer")
PATIENCE = 60.0
"""Longest wait, s."""


@contextmanager
def full_disk() -> Iterator[None]:
    """Let no file of this process grow, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def first(ask: Callable[[], Answer], is_met: Callable[[Answer], object]) -> Answer:
    """Return the first answer for which `is_met` holds."""
    deadline = time.monotonic() + PATIENCE
    while not is_met(answer := ask()):
        assert time.monotonic() < deadline, answer
    return answer


def until(happened: Callable[[], object]) -> None:
    """Wait for the action of another thread or process; other threads work meanwhile."""
    deadline = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < deadline, f"not within {PATIENCE:g} s"
        threading.Event().wait(0.001)
