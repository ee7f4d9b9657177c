"""`cell study ablation`: trials with all rules of the method, and again without each rule on the seeds on which it acted."""

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cell.commands.arguments import out_folder, require_known
from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.lab.ablation import frames
from cell.lab.ablation.rules import RULES, SCENES, rules_of
from cell.lab.ablation.switch import watching, without
from cell.lab.arguments import advancing, seeds_of
from cell.lab.report import StudyReport, reported
from cell.lab.tables import plain
from cell.lab.trials import TrialRow, run_trial, run_trials
from cell.records.statistics import student, wilson
from drivers.errors import ConfigError
from skills.contract import Outcome

ACTED, SPENT = "acted", "spent: "
"""Columns of a trial with all rules: rules that changed a decision, and the time in each rule's function, s per scan."""
Rows = Mapping[int, TrialRow]
"""Trials by seed."""


@dataclass(frozen=True, slots=True)
class Effect:
    """Effect of switching one rule off in one scene; a difference is the value without the rule minus the value with the rule."""

    rule: str
    scene: str
    trials: int
    """Number of paired seeds."""
    acted: int
    """Number of these seeds on which the rule acted."""
    lost: int
    """Number of seeds that succeed only with the rule."""
    gained: int
    """Number of seeds that succeed only without the rule."""
    most_lost: float
    """Upper bound of the share of seeds lost, one-sided 97.5 %, fraction."""
    time: float
    """Difference of the mean time of pairs that both succeed, fraction of the mean."""
    time_within: float
    """Half width of the 95 % interval of `time`, fraction."""
    p95: float
    """Difference of the 95th percentile of the time of the same pairs, fraction."""
    force: float
    """Mean difference of the largest contact force of the same pairs, N."""
    spent: float
    """Mean computing time in the rule's function, s per scan."""


def watched(scene: str, config: CellConfig, seed: int, **given: Any) -> TrialRow:
    """Run one trial of a scene with all rules; the row contains the rules that acted, and their times."""
    with watching(rules_of(scene)) as watch:
        row = run_trial(config, seed, **given)
    # The scan runs at 100 Hz.
    scans = row.sim_time * 100.0
    spent = {f"{SPENT}{name}": f"{time / scans:.6g}" for name, time in sorted(watch.spent.items())}
    return replace(row, more={ACTED: "; ".join(sorted(watch.acted)), **spent})


def deprived(rule: str, config: CellConfig, seed: int, **given: Any) -> TrialRow:
    """Run one trial without a rule."""
    with without([RULES[rule]]):
        return run_trial(config, seed, **given)


def has_acted(rule: str, row: TrialRow) -> bool:
    """Return True if a rule acted in a trial with all rules."""
    return rule in row.more[ACTED].split("; ")


def measure(
    args: argparse.Namespace, scene: str, only: Sequence[str], done: Callable[[TrialRow], None]
) -> list[Effect]:
    """Run a scene with all rules, then without each of its rules on the seeds on which that rule acted; return the effects.

    Trials are deterministic: on a seed on which a rule did not act, the trial without the rule would be the same. Finished
    trials are kept; a repeated call reads them instead of running them again.

    Args:
        args: Options of the study.
        scene: Name of the scene.
        only: Names of the rules to judge; none means all.
        done: Called with each trial.
    """

    def rows_of(name: str, keys: Sequence[str], of: Sequence[int], run: Any) -> Rows:
        config = load(sets=("sim.pace=max", *SCENES[scene], *keys)).cell
        folder = out_folder(args.out) / f"{scene} {name}".replace(" ", "-")
        return {row.seed: row for row in run_trials(config, of, args.workers, folder, done, run=run)}

    whole, found = rows_of("all rules", (), seeds_of(args, 40), partial(watched, scene)), []
    for rule in rules_of(scene):
        if not only or rule.name in only:
            acted = [seed for seed, row in whole.items() if has_acted(rule.name, row)]
            acted = acted[: args.most] if rule.always else acted
            without_it = rows_of(rule.name, rule.keys, acted, partial(deprived, rule.name)) if acted else {}
            found += effect(rule.name, scene, whole, without_it)
    return found


def effect(rule: str, scene: str, whole: Rows, without_it: Rows) -> list[Effect]:
    """Return the effect of a rule; empty if there are no pairs. A seed on which the rule did not act is a pair without difference.

    Raises:
        ConfigError: No pair succeeds.
    """
    pairs = [
        (row, without_it.get(seed, row))
        for seed, row in whole.items()
        if seed in without_it or not has_acted(rule, row)
    ]
    return [_effect(rule, scene, pairs)] if pairs else []


def _effect(rule: str, scene: str, pairs: Sequence[tuple[TrialRow, TrialRow]]) -> Effect:
    good = np.array([[row.outcome == Outcome.SUCCESS for row in pair] for pair in pairs])
    lost = int((good[:, 0] & ~good[:, 1]).sum())
    figures = [(a.total_time, b.total_time, b.peak_contact_force - a.peak_contact_force) for a, b in pairs]
    both = np.array(figures, dtype=float)[good.all(axis=1)]
    if not len(both):
        raise ConfigError(f"ablation: {rule}: in scene {scene}, no seed succeeds with and without the rule; one needed")
    before, after, harder = both.T
    change, usual = after - before, before.mean()
    within = student(len(both) - 1) * change.std(ddof=1) / math.sqrt(len(both)) if len(both) > 2 else math.inf
    old, new = np.quantile(before, 0.95), np.quantile(after, 0.95)
    return Effect(
        rule=rule,
        scene=scene,
        trials=len(pairs),
        acted=sum(has_acted(rule, a) for a, _ in pairs),
        lost=lost,
        gained=int((good[:, 1] & ~good[:, 0]).sum()),
        most_lost=wilson(lost, len(pairs))[1],
        time=float(change.mean() / usual),
        time_within=float(within / usual),
        p95=float(new / old - 1.0),
        force=float(harder.mean()),
        spent=float(np.mean([float(a.more.get(f"{SPENT}{rule}", 0.0)) for a, _ in pairs])),
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Run every scene with all rules and without each; existing trials are reused.

    Raises:
        ConfigError: A scene or a rule is unknown.
    """
    for option, names, known in (("--scene", args.scene, SCENES), ("--rule", args.rule, RULES)):
        for name in names:
            require_known(option, name, known)
    folder = out_folder(args.out)
    if args.frames:
        with advancing("frames", None) as done:
            lines = frames.measure(args.frames, done)
        shown = plain("Error of theta on single frames, degrees", lines)
        return reported(shown, folder, {"frames.csv": lines}, lines=lines)
    scenes = args.scene or (["honest"] if args.quick else [*SCENES])
    rules = args.rule or (["push-back"] if args.quick else ())
    found = list[Effect]()
    with advancing("trials", None) as done:
        for scene in scenes:
            found += measure(args, scene, rules, lambda row: done(1))
    shown = plain("Effect of each rule: without it, minus with it", found)
    return reported(shown, folder, {"ablation.csv": found}, effects=found)
