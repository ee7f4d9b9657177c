"""A serial cable between two programs of this computer."""

import os
import select
import threading
import tty
from typing import Self


class Cable:
    """Two pseudo terminals that pass on to each other what they get; `ends` are their ports."""

    def __init__(self) -> None:
        pairs = [os.openpty() for _ in range(2)]
        for _, end in pairs:
            tty.setraw(end)
        self.ends = [os.ttyname(end) for _, end in pairs]
        self._ends = [end for _, end in pairs]  # kept open, so that a client may close its own
        self._inner = [inner for inner, _ in pairs]
        self._cut, self._knife = os.pipe()
        self._thread = threading.Thread(target=self._pass_on)
        self._thread.start()

    def _pass_on(self) -> None:
        other = dict(zip(self._inner, reversed(self._inner), strict=True))
        while True:
            ready = select.select([*self._inner, self._cut], [], [])[0]
            if self._cut in ready:
                return
            for inner in ready:
                os.write(other[inner], os.read(inner, 4096))

    def close(self) -> None:
        os.write(self._knife, b"x")
        self._thread.join()
        for end in (*self._ends, *self._inner, self._cut, self._knife):
            os.close(end)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
