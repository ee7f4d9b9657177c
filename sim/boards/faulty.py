"""A device with faults, between any device and the cell, switched on and off at run time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

Change = Callable[[Any], Any]
"""Function from a reading to the changed one."""


@dataclass(slots=True)
class FaultyDevice:
    """A device with changed readings, which loses some commands."""

    device: Any
    change: Change = lambda reading: reading
    obeys: Callable[[str], bool] = lambda command: True
    """Function that returns False if a command of this name is lost."""

    def read(self) -> Any:
        """Return the newest reading after the change."""
        return self.change(self.device.read())

    def __getattr__(self, name: str) -> Any:
        return getattr(self.device, name) if self.obeys(name) else lambda *given: None


def kept(*names: str) -> Change:
    """Return the first reading forever: all of it, or these fields of it."""
    first: list[Any] = []

    def change(reading: Any) -> Any:
        first.append(reading)
        return replace(reading, **{name: getattr(first[0], name) for name in names}) if names else first[0]

    return change
