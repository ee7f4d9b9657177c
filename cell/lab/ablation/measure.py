"""Trials with all rules, and again without each rule on the seeds on which it acted."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.lab.ablation.rules import RULES, SCENES, rules_of
from cell.lab.ablation.switch import watching, without
from cell.lab.trials import run_trial
from cell.lab.workers import on_processes
from cell.records.statistics import student, wilson
from drivers.errors import ConfigError
from skills.contract import Outcome

ROWS = "ablation.jsonl"
SCANS_A_SECOND = 100.0


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial of a scene, with all rules or without one; SI units."""

    scene: str
    off: str
    """Name of the rule that was switched off; empty for none."""
    seed: int
    outcome: str
    reason: str
    time: float
    """Search, insertion and adjustment, s."""
    force: float
    """Largest net force between peg and plate, N."""
    retries: int
    acted: Sequence[str] = ()
    """Rules that changed a decision; with all rules only."""
    spent: Mapping[str, float] = field(default_factory=dict)
    """Time in each rule's function, s per scan; with all rules only."""

    @property
    def is_success(self) -> bool:
        """True if the peg was inserted."""
        return self.outcome == Outcome.SUCCESS


@dataclass(frozen=True, slots=True)
class Effect:
    """Effect of switching one rule off in one scene; differences are without minus with."""

    rule: str
    scene: str
    trials: int
    """Number of paired seeds."""
    acted: int
    """Number of these on which the rule acted."""
    lost: int
    """Number of seeds that succeed only with the rule."""
    gained: int
    """Number of seeds that succeed only without it."""
    most_lost: float
    """Upper bound of the share of seeds lost, one-sided 97.5 %, fraction."""
    time: float
    """Difference of the mean time of pairs that both succeed, fraction of the mean."""
    time_within: float
    """Half width of its 95 % interval, fraction."""
    p95: float
    """Difference of the 95th percentile of the time, fraction."""
    force: float
    """Difference of the mean force, N."""
    spent: float
    """Time in the rule's function, s per scan."""


def config_of(scene: str) -> CellConfig:
    """Return the config of a scene, at full speed."""
    return load(sets=("sim.pace=max", *SCENES[scene])).cell


def run_one(scene: str, off: str, seed: int) -> Trial:
    """Run one trial of a scene, without the rule named `off`, if any."""
    if off:
        config = load(sets=("sim.pace=max", *SCENES[scene], *RULES[off].keys)).cell
        with without([RULES[off]]):
            row = run_trial(config, seed)
        return Trial(
            scene, off, seed, row.outcome, row.reason, row.total_time or math.nan, row.peak_contact_force, row.retries
        )
    with watching(rules_of(scene)) as watch:
        row = run_trial(config_of(scene), seed)
    scans = row.sim_time * SCANS_A_SECOND
    spent = {name: time / scans for name, time in sorted(watch.spent.items())}
    made = Trial(
        scene, off, seed, row.outcome, row.reason, row.total_time or math.nan, row.peak_contact_force, row.retries
    )
    return replace(made, acted=sorted(watch.acted), spent=spent)


def measure(
    scene: str,
    seeds: Sequence[int],
    most: int,
    only: Sequence[str],
    workers: int,
    folder: Path,
    done: Callable[[], None],
) -> list[Trial]:
    """Run a scene with all rules, then without each of its rules on the seeds on which that rule acted.

    Trials are deterministic: if a rule did not act, its trial would be the same without it. Finished trials are kept, and
    the same call takes them up.

    Args:
        scene: Name of the scene.
        seeds: Seeds of the trials.
        most: Largest number of seeds, from the first on, for a rule that acts in every trial.
        only: Names of the rules to judge; none means all.
        workers: Number of processes.
        folder: Folder of the kept trials.
        done: Called after each trial.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / ROWS
    rows = {(row.scene, row.off, row.seed): row for row in kept(path)}
    found = _missing(rows, scene, "", seeds, workers, path, done)
    for rule in rules_of(scene):
        if not only or rule.name in only:
            acted = [row.seed for row in found if rule.name in row.acted]
            _missing(rows, scene, rule.name, acted[:most] if rule.always else acted, workers, path, done)
    return [row for row in rows.values() if row.scene == scene]


def kept(path: Path) -> list[Trial]:
    """Return the trials that are kept in a file; none without it."""
    if not path.exists():
        return []
    return [Trial(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def _missing(
    rows: dict[tuple[str, str, int], Trial],
    scene: str,
    off: str,
    seeds: Sequence[int],
    workers: int,
    path: Path,
    done: Callable[[], None],
) -> list[Trial]:
    missing = [seed for seed in seeds if (scene, off, seed) not in rows]
    with closing(on_processes(partial(run_one, scene, off), missing, workers)) as results:
        for row in results:
            rows[scene, off, row.seed] = row
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row)) + "\n")
            done()
    return [rows[scene, off, seed] for seed in seeds]


def effects(rows: Iterable[Trial]) -> list[Effect]:
    """Return the effect of each rule in each scene of the trials."""
    table = {(row.scene, row.off, row.seed): row for row in rows}
    tried = [
        (scene, rule.name) for scene in dict.fromkeys(row.scene for row in table.values()) for rule in rules_of(scene)
    ]
    found = [(rule, scene, list(_pairs(table, scene, rule))) for scene, rule in tried]
    return [_effect(rule, scene, pairs) for rule, scene, pairs in found if pairs]


def _pairs(table: Mapping[tuple[str, str, int], Trial], scene: str, rule: str) -> Iterator[tuple[Trial, Trial]]:
    """Yield the trials of a scene with all rules and without one; a seed on which it did not act is a pair without difference."""
    for (place, off, seed), row in table.items():
        if place == scene and not off:
            other = table.get((scene, rule, seed))
            if other is not None or rule not in row.acted:
                yield row, other or row


def _effect(rule: str, scene: str, pairs: Sequence[tuple[Trial, Trial]]) -> Effect:
    count = len(pairs)
    lost = sum(a.is_success > b.is_success for a, b in pairs)
    both = np.array([(a.time, b.time, b.force - a.force) for a, b in pairs if a.is_success and b.is_success])
    if not len(both):
        raise ConfigError(f"ablation: {rule}: no pair of trials of scene {scene} succeeds; one needed")
    before, after, harder = both.T
    change, usual = after - before, before.mean()
    within = student(len(both) - 1) * change.std(ddof=1) / math.sqrt(len(both)) if len(both) > 2 else math.inf
    old, new = np.quantile(before, 0.95), np.quantile(after, 0.95)
    return Effect(
        rule=rule,
        scene=scene,
        trials=count,
        acted=sum(rule in a.acted for a, _ in pairs),
        lost=lost,
        gained=sum(a.is_success < b.is_success for a, b in pairs),
        most_lost=wilson(lost, count)[1],
        time=float(change.mean() / usual),
        time_within=float(within / usual),
        p95=float(new / old - 1.0),
        force=float(harder.mean()),
        spent=float(np.mean([a.spent.get(rule, 0.0) for a, _ in pairs])),
    )
