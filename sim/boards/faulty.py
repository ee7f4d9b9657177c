"""A wrapper that adds faults to any device, switched on and off at run time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

Change = Callable[[Any], Any]
"""Function that returns a changed reading."""


@dataclass(slots=True)
class FaultyDevice:
    """A wrapper that changes a device's readings and loses some of its commands."""

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
    """Return a change that repeats the first reading forever: the whole reading, or only the fields `names`."""
    first: list[Any] = []

    def change(reading: Any) -> Any:
        first.append(reading)
        return replace(reading, **{name: getattr(first[0], name) for name in names}) if names else first[0]

    return change
