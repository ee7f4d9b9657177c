"""The computer's clock, for records only: a person or the network can set it at any time, so motion must not use it."""

from collections.abc import Iterable
from datetime import UTC, datetime


def now() -> datetime:
    """Return the wall time, UTC."""
    return datetime.now(UTC)


def local(moment: str) -> str:
    """Return a recorded wall time, ISO 8601, as local time with its offset from UTC; "-" if there is none."""
    return datetime.fromisoformat(moment).astimezone().strftime("%Y-%m-%d %H:%M:%S %z") if moment else "-"


def headed(name: str, moments: Iterable[str]) -> str:
    """Return the head of a column of local times with their zones, as "started (CET)"; `moments` are ISO 8601, or "" if missing."""
    zones = dict.fromkeys(datetime.fromisoformat(each).astimezone().strftime("%Z") for each in moments if each)
    return f"{name} ({'/'.join(zones)})" if zones else name


def now_text() -> str:
    """Return the wall time in the format of records: ISO 8601, UTC, milliseconds."""
    return now().isoformat(timespec="milliseconds")
