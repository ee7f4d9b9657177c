"""Progress of a run: completed stages, plus the fraction that the present stage reports; pure."""

from dataclasses import dataclass

from skills.entry import Entry, Program


@dataclass(slots=True)
class Progress:
    """Completed share of one run; it never decreases, even if stages are retried."""

    stages: tuple[str, ...]
    """Names of the stages of a run without failure, in order; all have equal weight."""
    percent: int = 0

    def update(self, stage: str, fraction: float) -> int:
        """Set the completed fraction of a stage, 0 to 1, and return the percentage of the run.

        A stage that is not in `stages`, for example recovery, does not change it.
        """
        if stage in self.stages:
            done = self.stages.index(stage) + min(max(fraction, 0.0), 1.0)
            self.percent = max(self.percent, int(100.0 * done / len(self.stages)))
        return self.percent


def progress_of(entry: Entry) -> Progress:
    """Return the progress of a program or a single skill before its start."""
    return Progress(entry.stages if isinstance(entry, Program) else (entry.name,))
