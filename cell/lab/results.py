"""Results of trials of one kind: success, time, force, and rotation of the peg in the hand."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.lab.rows import quantile
from cell.lab.trials import TrialRow
from cell.records.statistics import wilson
from sim.metering import OVER_FORCE
from skills.contract import Outcome


@dataclass(frozen=True, slots=True)
class TrialsResult:
    """Result of trials of one kind; times are those of the successes, s, forces each trial's largest, N; NaN if there are none."""

    name: str
    trials: int
    successes: int
    low: float
    """Lower end of the Wilson 95 % interval of the success rate."""
    high: float
    mean: float
    """Mean of the total time, search + insertion + adjustment."""
    p95: float
    force_median: float
    within: int
    """Number of trials whose largest contact force is at most `OVER_FORCE`."""
    turn_median: float
    """Median of the peg's largest rotation in the hand over all trials, rad."""
    turn_p95: float
    endings: str
    """Endings other than success with their counts, or the reason why nothing ran."""


def result_of(name: str, trials: Sequence[TrialRow], trouble: str = "") -> TrialsResult:
    """Return the result of trials; if they did not run, `trouble` is the reason."""
    good = [trial for trial in trials if trial.outcome == Outcome.SUCCESS]
    times = np.array([trial.total_time for trial in good], dtype=float)
    forces = np.array([trial.peak_contact_force for trial in trials], dtype=float)
    turns = np.array([trial.max_in_hand_rotation for trial in trials], dtype=float)
    low, high = wilson(len(good), len(trials))
    lost = Counter(f"{trial.stage} {trial.reason}".strip() for trial in trials if trial.outcome != Outcome.SUCCESS)
    return TrialsResult(
        name=name,
        trials=len(trials),
        successes=len(good),
        low=low,
        high=high,
        mean=float(times.mean()) if len(times) else float("nan"),
        p95=quantile(times, 0.95),
        force_median=quantile(forces, 0.5),
        within=int(np.count_nonzero(forces <= OVER_FORCE)),
        turn_median=quantile(turns, 0.5),
        turn_p95=quantile(turns, 0.95),
        endings=trouble or ", ".join(f"{count} x {text}" for text, count in lost.most_common()),
    )
