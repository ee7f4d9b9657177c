"""The meaning of a sequence number on its link; pure.

Numbers are compared modulo 65536: a number is ahead of another by 1 to 32768, else it is behind.

    | number                                     | with code 0     | with a stop     | with another command |
    | ------------------------------------------ | --------------- | --------------- | -------------------- |
    | the first of a link or of another writer   | FIRST           | FIRST           | FIRST                |
    | the same as the last one                   | SAME            | SAME            | SAME                 |
    | ahead of the last one                      | NEW             | NEW             | NEW                  |
    | ahead, the first one after a loss          | FIRST           | FIRST           | FIRST                |
    | behind the last one                        | ANEW            | LATE            | LATE                 |
    | in doubt: perhaps of the previous count    | ANEW            | DOUBT           | DOUBT                |

    | meaning | effect                                                                    | last number   |
    | ------- | ------------------------------------------------------------------------- | ------------- |
    | FIRST   | a stop is obeyed; another command is refused and never run                | this one      |
    | SAME    | none: the answer stays                                                    | unchanged     |
    | NEW     | the command counts, once                                                  | this one      |
    | ANEW    | a program restarts on an open link: the number counts as received         | this one      |
    | LATE    | a stop is obeyed; another command is refused and never run                | unchanged     |
    | DOUBT   | a stop is obeyed; another command waits for the next block                | unchanged     |

If both a number and the life counter of its block are behind the last ones, there are two possible causes: an old block
arrived late, or a program has restarted. The link keeps both counts until later blocks decide. If the life counter of a
later block continues the previous count, the previous count is valid. The previous count ends as soon as a block has a
command that this count never had, or at the third block in a row whose life counter follows the new count.
"""

from dataclasses import dataclass, field
from enum import Enum, auto

_MODULUS = 0x10000
KEPT = 256
"""Number of stored numbers of one count; an older number counts as received, but its command is no longer known."""
CONFIRMED = 3
"""Number of blocks in a row that end the doubt: no line delivers three old blocks, in order, between two new blocks."""

Asked = tuple[int, int, str] | None
"""Code, recipe and serial number of a block; None with code 0."""


class NumberMeaning(Enum):
    """Meaning of a number on its link."""

    FIRST = auto()
    """The number is adopted and never run."""
    SAME = auto()
    """The number repeats an earlier one and changes nothing."""
    LATE = auto()
    """The number belongs to an old write that arrived late."""
    NEW = auto()
    """The number is a command, which counts once."""
    ANEW = auto()
    """The number begins the count of a restarted program."""
    DOUBT = auto()
    """The number belongs to an old block or to a new command; the next block decides."""


@dataclass(slots=True)
class _Seen:
    """A received number: its first command, and the life counters of its first and its newest block."""

    asked: Asked
    first: int
    newest: int


@dataclass(slots=True)
class _Count:
    """The numbers of one writer since its first."""

    first: int
    last: int
    life: int
    """Life counter of the newest block."""
    blocks: int = 1
    """Number of blocks in a row with an advancing life counter."""
    seen: dict[int, _Seen] = field(default_factory=dict)

    def take(self, number: int, asked: Asked, life: int) -> None:
        """Take a block that belongs to this count."""
        newest = life if number != self.last or _is_behind(self.life, life) else self.life
        self.follow(life)
        self.life = newest
        if number != self.last or number not in self.seen:
            self.seen.pop(number, None)
            self.seen[number] = _Seen(asked, life, life)
            if len(self.seen) > KEPT:
                del self.seen[next(iter(self.seen))]
        seen = self.seen[number]
        seen.asked, seen.newest = seen.asked or asked, self.life
        self.last = number

    def follow(self, life: int) -> None:
        """Count a block if its life counter has advanced; restart the count if it has gone back."""
        if life != self.life:
            self.blocks = 1 if _is_behind(life, self.life) else self.blocks + 1
        self.life = life

    def repeats(self, number: int, asked: Asked) -> bool:
        """Return True if a block repeats the last one, with or without its command."""
        return number == self.last and asked in (None, self.seen[number].asked)

    def goes_on(self, life: int, other: int) -> bool:
        """Return True if a life counter continues this count, and is closer to it than to `other`."""
        return _is_behind(self.life, life) and (life - self.life) % _MODULUS < (life - other) % _MODULUS

    def had(self, number: int, asked: Asked, life: int) -> bool:
        """Return True if a block was received before, or was overtaken by a received one."""
        seen = self.seen.get(number)
        if seen is not None:
            return asked in (None, seen.asked) and not (_is_behind(life, seen.first) or _is_behind(seen.newest, life))
        is_between = (number - self.first) % _MODULUS < (self.last - self.first) % _MODULUS
        return is_between and _is_behind(life, self.life)


@dataclass(slots=True)
class SequenceNumbers:
    """The numbers of one link."""

    must_adopt: bool = True
    """True if no number was received since the link opened or since it was lost."""
    _count: _Count | None = None
    is_anew: bool = False
    """True if the last number is, or may be, the first of a restarted program."""
    _doubted: _Count | None = None
    """Previous count, while both counts may be valid."""
    _given: int = 0
    """Number of commands that came without a number."""

    @property
    def last(self) -> int | None:
        """Last received number, None before the first."""
        return self._count.last if self._count is not None else None

    @property
    def is_in_doubt(self) -> bool:
        """True if the last number may belong to an old block."""
        return self._doubted is not None

    def see(self, number: int, asked: Asked = None, life: int = 0) -> NumberMeaning:
        """Take the number of a block just written, with its command and life counter, and return its meaning."""
        if self._count is None:
            self._begin(number, asked, life)
            return NumberMeaning.FIRST
        if self._is_doubted(self._count, number, asked, life):
            if asked is None:
                return self._begin_anew(number, asked, life)
            self._count.follow(life)
            return NumberMeaning.DOUBT
        count = self._count
        if number == count.last:
            self.must_adopt = False
            count.take(number, asked, life)
            return NumberMeaning.SAME
        if not _is_behind(number, count.last):
            verdict = NumberMeaning.FIRST if self.must_adopt else NumberMeaning.NEW
            self.must_adopt, self._doubted = False, None
            count.take(number, asked, life)
            return verdict
        is_old = _is_behind(life, count.life)
        if asked is None or is_old:
            return self._begin_anew(number, asked, life, count if is_old else None)
        return NumberMeaning.LATE

    def _is_doubted(self, count: _Count, number: int, asked: Asked, life: int) -> bool:
        """Decide between two counts if a block settles the doubt; return True if it may be an old block of the previous count."""
        doubted = self._doubted
        if doubted is None:
            return False
        if doubted.goes_on(life, count.life):
            self._count, self._doubted, self.is_anew = doubted, None, False
        elif count.blocks >= CONFIRMED - 1 and _is_behind(count.life, life):
            self._doubted = None
        else:
            return not count.repeats(number, asked) and doubted.had(number, asked, life)
        return False

    def give(self) -> int:
        """Return a number for a command that came without one, far from those that the client sends next."""
        self._given = self._given % (_MODULUS // 4) + 1
        start = 0 if self.last is None else self.last + _MODULUS // 2
        return (start + self._given) % _MODULUS

    def forget(self) -> None:
        """Adopt the next number."""
        self.must_adopt = True

    def would_count(self, number: int) -> bool:
        """Return True if a number would be a new one."""
        return not self.must_adopt and self.last not in (None, number) and not _is_behind(number, self.last or 0)

    def _begin_anew(self, number: int, asked: Asked, life: int, doubted: _Count | None = None) -> NumberMeaning:
        self._doubted = self._doubted or doubted
        self._begin(number, asked, life)
        self.is_anew = True
        return NumberMeaning.ANEW if asked is None else NumberMeaning.LATE

    def _begin(self, number: int, asked: Asked, life: int) -> None:
        self._count = _Count(number, number, life, seen={number: _Seen(asked, life, life)})
        self.must_adopt = False


def _is_behind(number: int, other: int) -> bool:
    return 0 < (other - number) % _MODULUS < _MODULUS // 2
