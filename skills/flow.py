"""Composition of skills: in order, with retries, and with stages on record."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.errors import CellError
from skills.contract import Interrupted, Outcome, Reason, SkillContext, SkillResult

Step = Callable[[SkillContext], SkillResult]


@dataclass(frozen=True, slots=True)
class StageRecord:
    """One skill of a run, as it ended."""

    name: str
    result: SkillResult
    started: float
    """Start of the skill, s, on the cell's clock."""
    ended: float
    """End of the skill, s, on the cell's clock."""
    retried: bool = False
    """Whether the skill failed and the program tried again."""


def run_stage(name: str, step: Step, ctx: SkillContext) -> StageRecord:
    """Run one step under its name; an interruption becomes its result.

    Raises:
        CellError: The step answers with something else than a result, or something is broken; the supervisor stops, reports and re-arms.
    """
    ctx.stage = name
    ctx.progress(0.0)
    started = ctx.clock.now()
    try:
        result = step(ctx)
    except Interrupted as interruption:
        outcome = Outcome.ABORTED if interruption.reason is Reason.STOPPED else Outcome.FAILURE
        result = SkillResult(outcome, interruption.reason, ctx.clock.now() - started)
    if not isinstance(result, SkillResult):
        raise CellError(f"{name}: run returned {type(result).__name__}; a SkillResult allowed")
    ctx.ended(name, result.elapsed)
    return StageRecord(name, result, started, ctx.clock.now())


def in_order(steps: Sequence[tuple[str, Step]], ctx: SkillContext) -> list[StageRecord]:
    """Run named steps one after the other until one does not succeed; return the steps that were run."""
    records: list[StageRecord] = []
    for name, step in steps:
        records.append(run_stage(name, step, ctx))
        if records[-1].result.outcome is not Outcome.SUCCESS:
            break
    return records
