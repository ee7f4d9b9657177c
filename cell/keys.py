"""Keys that a person presses, one by one: of a terminal at once, of a pipe as fast as they are asked for."""

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

END = "q"
"""Key that ends; also what a closed input counts as."""


class Keys:
    """The keys of standard input."""

    def __init__(self, is_terminal: bool) -> None:
        """Take whether a person sits at it."""
        self._is_terminal = is_terminal

    def next(self, is_waiting: bool) -> str:
        """Return the next key, or nothing.

        Args:
            is_waiting: Whether nothing is under way. A pipe gives its next key only then, so that each has its effect; a terminal
                gives the newest one.
        """
        if self._is_terminal:
            key = ""
            while select.select([sys.stdin], [], [], 0.0)[0]:
                key = os.read(sys.stdin.fileno(), 1).decode(errors="replace") or END
                if key == END:
                    break
            return key
        if not is_waiting:
            return ""
        while (key := sys.stdin.read(1)).isspace():
            pass
        return key or END


@contextmanager
def keys() -> Iterator[Keys]:
    """Yield the keys of standard input; a terminal gives each at once, without Enter and without an echo."""
    if not sys.stdin.isatty():
        yield Keys(False)
        return
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield Keys(True)
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
