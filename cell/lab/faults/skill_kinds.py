"""Faults of skills: a skill raises, blocks, requests wrong motions, or reports a false success."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import ModuleType

import numpy as np

from cell.lab.faults.bench import FaultBench
from cell.lab.faults.contract import FaultKind, Undo, changed
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


def _raises(bench: FaultBench) -> None:
    raise ValueError("a skill that nobody tested")


def _blocks(bench: FaultBench) -> None:
    bench.cell.clock.wait_until(bench.cell.clock.now() + BLOCKED)


def _asks(make: Callable[[], Wrong], bench: FaultBench) -> Undo:
    wrong, follow = make(), SkillContext.follow
    return changed(SkillContext, "follow", lambda ctx, setpoint: follow(ctx, wrong(setpoint)))


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
    undo = [changed(module, "run", lambda *given, result=result, **named: result) for module, result in said]
    return lambda: [each() for each in undo]


SKILL_KINDS: tuple[FaultKind, ...] = (
    FaultKind("skill: raises", _raises),
    FaultKind("skill: blocks", _blocks),
    FaultKind("skill: asks for no number", partial(_asks, lambda: _shifted(np.full(3, np.nan)))),
    FaultKind("skill: asks for far away", partial(_asks, lambda: _shifted(np.array([FAR, 0.0, 0.0])))),
    FaultKind("skill: presses", partial(_asks, lambda: _shifted(-DEEP * UP))),
    FaultKind("skill: drifts downward", partial(_asks, _drifting)),
    FaultKind("skill: lies", _lies, slow="what it says is judged when the run ends"),
)
"""All kinds of skill faults."""
