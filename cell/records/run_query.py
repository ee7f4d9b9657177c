"""Selection of runs: from options to an SQL condition; pure."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from drivers.errors import ConfigError

OUTCOMES = ("success", "failure", "aborted", "fault", "lost", "running")
"""Outcomes of runs on record; the present run has the outcome `running`."""
NEVER = "9999"
"""Text that sorts after every wall time of the records."""
_SPAN = re.compile(r"(\d{1,6})([mhdw])")
_UNITS = {"m": "minutes", "h": "hours", "d": "days", "w": "weeks"}


@dataclass(frozen=True, slots=True)
class RunQuery:
    """Conditions on runs, all of which must hold; None sets no condition."""

    since: str = ""
    """Earliest start of a run, wall time, ISO 8601 UTC."""
    until: str = ""
    """Time before which a run started, wall time, ISO 8601 UTC; empty for no limit."""
    outcome: str | None = None
    fault: int | None = None
    serial: str | None = None
    """Serial number of the part."""
    program: str | None = None
    recipe: int | None = None

    def where(self) -> tuple[str, list[object]]:
        """Return an SQL condition on the table `runs` and the values of its question marks."""
        times = {"started >= ?": self.since}
        if self.until:  # with a second condition on time, SQLite would sort all runs to find the newest
            times["started < ?"] = self.until
        names = ("outcome", "fault", "serial", "program", "recipe")
        given = {f"{name} = ?": value for name in names if (value := getattr(self, name)) is not None}
        return " AND ".join([*times, *given]), [*times.values(), *given.values()]


def moment(text: str, now: datetime, option: str = "--since") -> str:
    """Return the wall time of a date and time, or of a span before `now` such as 7d, in the format of records.

    Raises:
        ConfigError: The text is neither a span nor a date; the message names `option`, the source of the text.
    """
    span = _SPAN.fullmatch(text)
    try:
        back = timedelta(**{_UNITS[span[2]]: int(span[1])}) if span else timedelta()
        found = now - back if span else datetime.fromisoformat(text)
    except (ValueError, OverflowError):
        raise ConfigError(
            f"{option} {text}: 30m, 12h, 7d, 4w or a date as 2025-01-31 or 2025-01-31T06:00 in local time allowed"
        ) from None
    return found.astimezone(UTC).isoformat(timespec="milliseconds")
