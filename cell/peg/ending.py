"""The end of a run: its outcome, stage and reason."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import CellError
from skills.contract import Outcome, Reason
from skills.flow import StageRecord


@dataclass(frozen=True, slots=True)
class Ending:
    """End of a run."""

    outcome: Outcome
    stage: str
    """Name of the stage that did not succeed, else of the last one."""
    reason: IntEnum
    """Reason of the end, a `Reason` or one of the skill's own."""

    @property
    def word(self) -> str:
        """The reason in lower case, for records; empty if there is none."""
        return "" if self.reason is Reason.NONE else self.reason.name.lower()


def ending_of(records: Sequence[StageRecord], fault: CellError | None, stage: str) -> Ending:
    """Return the ending of a run: that of the first failed stage that was not retried, else the last; or a fault in `stage`."""
    if fault is not None or not records:
        return Ending(Outcome.FAULT, stage, Reason.NONE)
    last = next(
        (record for record in records if record.result.outcome is not Outcome.SUCCESS and not record.retried),
        records[-1],
    )
    return Ending(last.result.outcome, last.name, last.result.reason)
