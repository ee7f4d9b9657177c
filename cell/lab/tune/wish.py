"""A technician's wish for time, force and success, and the distance of trials from it; without side effects."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cell.lab.rows import average, known, quantile, successes
from cell.lab.trials import TrialRow
from cell.records.statistics import wilson
from drivers.errors import ConfigError
from skills.contract import Outcome

_TERM = re.compile(r"\s*(\w+)\s*(<=|>=)\s*([0-9.]+)\s*(s|N|%)?\s*")
LOST = 3.0
"""Cost of a lost trial; a trial that just fulfils the wish costs 1."""


@dataclass(frozen=True, slots=True)
class Kind:
    """One quantity that a wish can limit."""

    sign: str
    unit: str
    value: Callable[[Sequence[TrialRow]], float]
    """Function that returns the quantity over trials, in its unit; NaN if the trials have no value."""


def _times(rows: Sequence[TrialRow]) -> list[float]:
    return known(row.total_time for row in successes(rows))


def _share(rows: Sequence[TrialRow]) -> float:
    return 100.0 * len(successes(rows)) / len(rows) if rows else math.nan


KINDS: dict[str, Kind] = {
    "mean": Kind("<=", "s", lambda rows: average(_times(rows))),
    "p95": Kind("<=", "s", lambda rows: quantile(_times(rows), 0.95)),
    "force": Kind("<=", "N", lambda rows: quantile([row.peak_contact_force for row in rows], 0.95)),
    "success": Kind(">=", "%", _share),
}
"""Quantities for wishes, by name: times are search + insertion + adjustment, the force is each trial's largest."""


@dataclass(frozen=True, slots=True)
class Wish:
    """One condition."""

    name: str
    limit: float

    @property
    def kind(self) -> Kind:
        """Quantity of the condition."""
        return KINDS[self.name]

    @property
    def text(self) -> str:
        """Text of the condition in the form of `wishes_of`."""
        return f"{self.name}{self.kind.sign}{self.limit:g} {self.kind.unit}"

    def holds(self, rows: Sequence[TrialRow]) -> bool:
        """Return True if trials fulfil the condition."""
        value = self.kind.value(rows)
        return value <= self.limit if self.kind.sign == "<=" else value >= self.limit

    def found(self, rows: Sequence[TrialRow]) -> str:
        """Return the result of trials in words."""
        value = f"{self.kind.value(rows):.3g} {self.kind.unit}"
        if self.name != "success":
            return value
        low, high = wilson(len(successes(rows)), len(rows))
        return f"{value} of {len(rows)}, 95 % interval {100 * low:.1f} to {100 * high:.1f} %"


def wishes_of(text: str) -> tuple[Wish, ...]:
    """Return the conditions of a text such as `p95<=8 s, force<=20 N`.

    Raises:
        ConfigError: The text has another form, or contains a quantity twice.
    """
    found: dict[str, Wish] = {}
    for term in text.split(","):
        wish = _wish(term, text)
        if wish.name in found:
            raise ConfigError(f"--want {text}: {wish.name} twice; each once allowed")
        found[wish.name] = wish
    return tuple(found.values())


def _wish(term: str, text: str) -> Wish:
    """Return the condition of one term of a text; see `wishes_of`."""
    match = _TERM.fullmatch(term)
    kind = KINDS.get(match[1]) if match else None
    if match is None or kind is None or match[2] != kind.sign or match[4] not in (None, kind.unit):
        allowed = ", ".join(f"{name}{kind.sign}{kind.unit}" for name, kind in KINDS.items())
        raise ConfigError(f"--want {text}: {term.strip()!r}: {allowed} allowed, as in p95<=8 s, force<=20 N")
    try:
        limit = float(match[3])
    except ValueError:
        raise ConfigError(f"--want {text}: {match[3]} is not a number; 8 or 8.5 allowed") from None
    most, ceiling = (100.0, ", at most 100 %") if kind.unit == "%" else (math.inf, "")
    if not 0.0 < limit <= most:
        raise ConfigError(f"--want {text}: {limit:g}: more than 0{ceiling} allowed")
    return Wish(match[1], limit)


def cost(row: TrialRow, wishes: Sequence[Wish]) -> float:
    """Return the cost of one trial for a wish: 1 if the trial just fulfils the wish, more beyond a limit, less if it is faster.

    Time always contributes, so that the faster of two settings that fulfil the wish costs less. The excess of the force over
    its limit, and of the time over a limit of `p95`, is added twice. A lost trial costs `LOST`, and no trial costs more.
    """
    if row.outcome != Outcome.SUCCESS or row.total_time is None:
        return LOST
    limits = {wish.name: wish.limit for wish in wishes}
    time = row.total_time / limits.get("p95", limits.get("mean", 60.0))
    beyond = max(time - 1.0, 0.0) if "p95" in limits else 0.0
    force = max(row.peak_contact_force / limits["force"] - 1.0, 0.0) if "force" in limits else 0.0
    return min(time + 2.0 * (beyond + force), LOST)
