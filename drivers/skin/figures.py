"""Reception figures of a skin board; pure."""

from dataclasses import dataclass

from drivers.quantities import Vector


@dataclass(frozen=True, slots=True, eq=False)
class SkinFigures:
    """Reception of the skin since it was opened."""

    scans: int
    """Number of complete scans received."""
    lost: int
    """Number of incomplete or missing scans between received ones."""
    refused: int
    """Number of messages refused for their check sum, their length, or a missing part."""
    rate: float
    """Rate of the newest scans, Hz; NaN before the second scan."""
    age: float
    """Time since the arrival of the newest scan, s; infinite before the first scan."""
    temperature: Vector
    """Raw temperature reading of each module, shape (4,), counts; NaN if a module has no such channel."""
