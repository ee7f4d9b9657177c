"""How much of a run is done: whole stages, and of the one under way the part that it says itself; pure."""

from dataclasses import dataclass

from skills.entry import Entry, Program


@dataclass(slots=True)
class Progress:
    """The share of one run that is done; it never falls, also where stages are tried again."""

    stages: tuple[str, ...]
    """Names of the stages of a run in which everything succeeds, in order; each counts the same."""
    percent: int = 0

    def update(self, stage: str, fraction: float) -> int:
        """Take how much of a stage is done, 0 to 1, and return the percentage of the run.

        A stage outside the usual way, as one that clears up after a failure, leaves it as it is.
        """
        if stage in self.stages:
            done = self.stages.index(stage) + min(max(fraction, 0.0), 1.0)
            self.percent = max(self.percent, int(100.0 * done / len(self.stages)))
        return self.percent


def progress_of(entry: Entry) -> Progress:
    """Return the progress of a program or a single skill before it begins."""
    return Progress(entry.stages if isinstance(entry, Program) else (entry.name,))
