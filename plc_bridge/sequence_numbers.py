"""The sequence numbers of a link that count as commands; pure.

| seen on a link                            | verdict |
| --------------------------------------------- | ------- |
| one of the last `LATE_WINDOW` before the last | LATE    |
| the first one after it opened or was lost | FIRST   |
| the same again, whatever else the block holds | SAME    |
| any other                                 | NEW     |
"""

from dataclasses import dataclass
from enum import Enum, auto

LATE_WINDOW = 256
"""Distance by which a number may lie behind and still be an old write; further behind the PLC's counter has restarted."""
_MODULUS = 0x10000


class Verdict(Enum):
    """Meaning of a number on the link that wrote it."""

    FIRST = auto()
    """The number is adopted and never run."""
    SAME = auto()
    """The number was seen before and changes nothing."""
    LATE = auto()
    """The number belongs to an old write that arrived late."""
    NEW = auto()
    """The number is a command, which counts once."""


@dataclass(slots=True)
class SequenceNumbers:
    """The numbers of one link."""

    last: int | None = None
    """Number seen last, None before the first."""
    must_adopt: bool = True
    """Whether no number was seen since the link opened or since it was lost."""

    def see(self, number: int) -> Verdict:
        """Take the number of a block just written and return its meaning."""
        last = self.last
        if last is not None and number != last and (last - number) % _MODULUS <= LATE_WINDOW:
            return Verdict.LATE
        self.last = number
        if self.must_adopt:
            self.must_adopt = False
            return Verdict.FIRST
        return Verdict.SAME if number == last else Verdict.NEW

    def count_up(self) -> int:
        """Return the next number, for a command that comes without one, and take it for seen."""
        self.last = ((self.last or 0) + 1) % _MODULUS
        return self.last

    def forget(self) -> None:
        """Let the next number be adopted."""
        self.must_adopt = True
