"""Composition of skills: run them in order and record each stage."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.errors import CellError
from skills.contract import Interrupted, Outcome, Reason, Request, SkillContext, SkillResult

Step = Callable[[SkillContext], SkillResult]


@dataclass(frozen=True, slots=True)
class StageRecord:
    """Record of one skill of a run after its end."""

    name: str
    result: SkillResult
    started: float
    """Start of the skill, s, on the cell's clock."""
    ended: float
    """End of the skill, s, on the cell's clock."""
    retried: bool = False
    """True if the skill failed and the program tried again."""


def run_stage(name: str, step: Step, ctx: SkillContext) -> StageRecord:
    """Run one step under its name; an interruption is converted to a result.

    Raises:
        CellError: The step did not return a `SkillResult`, or the step raised a fault.
    """
    ctx.stage = name
    ctx.callbacks.progress(0.0)
    started = ctx.devices.clock.now()
    try:
        # A hold or a stop may have come before the first scan of the skill, which can open the hand before that scan.
        if ctx.callbacks.poll() is not Request.RUN:
            next(ctx.scan(math.inf))
        result = step(ctx)
    except Interrupted as interruption:
        outcome = Outcome.ABORTED if interruption.reason is Reason.STOPPED else Outcome.FAILURE
        result = SkillResult(outcome, interruption.reason, ctx.devices.clock.now() - started)
    if not isinstance(result, SkillResult):
        raise CellError(f"{name}: run returned {type(result).__name__}; a SkillResult allowed")
    ctx.callbacks.ended(name, result.elapsed)
    return StageRecord(name, result, started, ctx.devices.clock.now())


def in_order(steps: Sequence[tuple[str, Step]], ctx: SkillContext) -> list[StageRecord]:
    """Run named steps in order until one does not succeed; return the records of the steps run."""
    records: list[StageRecord] = []
    for name, step in steps:
        records.append(run_stage(name, step, ctx))
        if records[-1].result.outcome is not Outcome.SUCCESS:
            break
    return records
