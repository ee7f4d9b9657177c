"""Faults of skills: a skill raises, blocks, requests wrong motions, or reports a false success."""

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np

from cell.lab.faults.bench import FaultBench
from cell.lab.faults.contract import FaultKind, Undo
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, Vector
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.insert import spiral_adjust, tactile_insert
from skills.insert.spiral_adjust import SpiralAdjustResult
from skills.insert.tactile_insert import TactileInsertResult
from skills.search import spray_search
from skills.search.spray_search import SpraySearchResult

BLOCKED = 0.5
"""Time without a scan in a skill, s."""
FAR, DEEP, DRIFT = 0.5, 0.09, 0.002
"""Errors of a setpoint: sideways at once, downward at once, and downward increasing with each scan, m."""
DONE = (Outcome.SUCCESS, Reason.NONE, 0.0)
Wrong = Callable[[ImpedanceSetpoint], ImpedanceSetpoint]


def _raises(bench: FaultBench) -> Undo:
    raise ValueError("a skill that nobody tested")


def _blocks(bench: FaultBench) -> Undo:
    bench.cell.clock.wait_until(bench.cell.clock.now() + BLOCKED)
    return lambda: None


def _asks(make: Callable[[], Wrong]) -> Callable[[FaultBench], Undo]:
    def begin(bench: FaultBench) -> Undo:
        wrong, follow = make(), SkillContext.follow

        def followed(ctx: SkillContext, setpoint: ImpedanceSetpoint) -> None:
            follow(ctx, wrong(setpoint))

        setattr(SkillContext, "follow", followed)  # noqa: B010 - a method is no variable to the type checker
        return lambda: setattr(SkillContext, "follow", follow)

    return begin


def _shifted(way: Vector) -> Wrong:
    return lambda setpoint: replace(setpoint, tip=setpoint.tip + way)


def _drifting() -> Wrong:
    scans: list[int] = []

    def wrong(setpoint: ImpedanceSetpoint) -> ImpedanceSetpoint:
        scans.append(0)
        return replace(setpoint, tip=setpoint.tip - DRIFT * len(scans) * UP)

    return wrong


def _lies(bench: FaultBench) -> Undo:
    """Let every later skill, up to the last, report success without doing anything."""
    said: tuple[tuple[ModuleType, SkillResult], ...] = (
        (spray_search, SpraySearchResult(*DONE, (0.5, 0.0, 0.1), (0.5, 0.0), 0, None)),
        (tactile_insert, TactileInsertResult(*DONE, 0.0, 0.0)),
        (spiral_adjust, SpiralAdjustResult(*DONE, 0.0, 0.02)),
    )
    before = [(module, vars(module)["run"]) for module, _ in said]
    for module, result in said:
        vars(module)["run"] = lambda *given, result=result, **named: result

    def undo() -> None:
        for module, run in before:
            vars(module)["run"] = run

    return undo


SKILL_KINDS: tuple[FaultKind, ...] = (
    FaultKind("skill: raises", _raises),
    FaultKind("skill: blocks", _blocks),
    FaultKind("skill: asks for no number", _asks(lambda: _shifted(np.full(3, np.nan)))),
    FaultKind("skill: asks for far away", _asks(lambda: _shifted(np.array([FAR, 0.0, 0.0])))),
    FaultKind("skill: presses", _asks(lambda: _shifted(-DEEP * UP))),
    FaultKind("skill: drifts downward", _asks(_drifting)),
    FaultKind("skill: lies", _lies, slow="what it says is judged when the run ends"),
)
"""All kinds of skill faults."""
