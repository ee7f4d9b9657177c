"""Sequential tests of a share of trials; pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from cell.lab.rows import Ended, successes
from cell.records.statistics import wilson


class Verdict(StrEnum):
    """Answer of a sequential test."""

    GOOD = "good"
    BAD = "bad"
    OPEN = "undecided"


@dataclass(frozen=True, slots=True)
class RateTest:
    """Sequential probability ratio test between two shares of lost trials, [wald].

    If a setting loses the share `good`, the answer is BAD with a probability of at most about `error`; if it loses the share
    `bad`, the answer is GOOD with a probability of at most about `error`. Between the two shares, either answer is possible.
    Wilson intervals at the end of the test contain the true share less often than those of a fixed number of trials:
    [siegmund].
    """

    good: float
    """Share of lost trials of a good setting, above 0."""
    bad: float
    """Share of lost trials of a bad setting, above `good` and below 1."""
    error: float = 0.05
    """Probability of each wrong answer."""
    least: int = 1
    """Least number of trials before an answer, so that the interval of the success rate is not too wide."""

    def verdict(self, lost: int, trials: int) -> Verdict:
        """Return the answer after `trials` trials with `lost` lost ones."""
        if trials < self.least:
            return Verdict.OPEN
        kept = (trials - lost) * math.log((1.0 - self.bad) / (1.0 - self.good))
        ratio = lost * math.log(self.bad / self.good) + kept
        bound = math.log((1.0 - self.error) / self.error)
        if abs(ratio) < bound:
            return Verdict.OPEN
        return Verdict.BAD if ratio > 0.0 else Verdict.GOOD

    def of(self, rows: Sequence[Ended]) -> Verdict:
        """Return the answer for the trials in `rows`."""
        return self.verdict(len(rows) - len(successes(rows)), len(rows))

    def is_answered(self, rows: Sequence[Ended]) -> bool:
        """Return True if the trials in `rows` are enough for an answer."""
        return self.of(rows) is not Verdict.OPEN


@dataclass(frozen=True, slots=True)
class LevelTest:
    """Finds between which levels a share of successes is, by its Wilson interval at every `every`-th trial.

    With the levels 50 and 90 %, every 20 trials up to 200, the interval at the end contains the true share with a
    probability of at least 92 %, and of at least 81 % if the share is within 4 % of a level.
    """

    levels: tuple[float, ...]
    """Shares of successes, ascending, fraction."""
    every: int

    def of(self, rows: Sequence[Ended]) -> str:
        """Return the levels on both sides of the interval, for example "50 to 90 %"; empty if the interval contains a level."""
        low, high = wilson(len(successes(rows)), len(rows))
        if any(low <= level <= high for level in self.levels):
            return ""
        below = max((level for level in self.levels if level < low), default=0.0)
        above = min((level for level in self.levels if level > high), default=1.0)
        return f"{100 * below:.0f} to {100 * above:.0f} %"

    def is_answered(self, rows: Sequence[Ended]) -> bool:
        """Return True if the trials in `rows` are enough for an answer."""
        return len(rows) % self.every == 0 and self.of(rows) != ""
