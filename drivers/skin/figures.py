"""How well a skin board is heard, as values; pure."""

from dataclasses import dataclass

from drivers.quantities import Vector


@dataclass(frozen=True, slots=True, eq=False)
class SkinFigures:
    """How well the skin is heard, since it was opened."""

    scans: int
    """Whole scans received."""
    lost: int
    """Scans that the board numbered and that never came whole."""
    refused: int
    """Messages that were none: check sum, length, or a part missing."""
    rate: float
    """Of the newest scans, Hz; NaN before the second."""
    age: float
    """Time since the newest scan came, s; infinite before the first."""
    temperature: Vector
    """Raw reading of each module, shape (4,), counts; NaN where it has none."""
