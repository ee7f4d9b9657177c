"""Key presses of a person, one by one: a terminal returns the newest key, a pipe its next key when no motion is under way."""

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

END = "q"
"""Key that ends the command; a closed input counts as this key."""


class Keys:
    """The keys of standard input."""

    def __init__(self, is_terminal: bool) -> None:
        """Store the kind of standard input."""
        self._is_terminal = is_terminal

    def next(self, is_waiting: bool) -> str:
        """Return the next key; empty if there is none.

        Args:
            is_waiting: True if no motion is under way. A pipe returns its next key only then, so that each key has its effect; a
                terminal returns the newest key.
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
    """Yield the keys of standard input; a terminal returns each at once, without Enter and without echo."""
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
