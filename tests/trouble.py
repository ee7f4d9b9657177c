"""Trouble with the disk, and the wait for what another thread does about it."""

import resource
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def full_disk() -> Iterator[None]:
    """Let no file of this process grow, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def until(happened: Callable[[], object]) -> None:
    """Wait for what another thread does."""
    while not happened():
        threading.Event().wait(0.001)
