"""The computer's clock, which a person or the network may set at any moment: records carry it, and nothing that moves is timed by it."""

from datetime import UTC, datetime


def now() -> datetime:
    """Return the wall time, UTC."""
    return datetime.now(UTC)


def local(moment: str) -> str:
    """Return a wall time of the records, ISO 8601, in local time with its offset from UTC; "-" if there is none."""
    return datetime.fromisoformat(moment).astimezone().strftime("%Y-%m-%d %H:%M:%S %z") if moment else "-"


def now_text() -> str:
    """Return the wall time as records have it: ISO 8601, UTC, to a millisecond."""
    return now().isoformat(timespec="milliseconds")
