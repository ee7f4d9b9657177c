"""Limits of force and position that end a skill at once."""

from typing import Annotated, ClassVar

from pydantic import Field

from drivers.config_model import ConfigModel, Quantity
from drivers.parts import Point


class Limits(ConfigModel):
    """Limits that end a skill at once; every config must state them."""

    SOURCE: ClassVar[str] = "set for each cell"

    force: Annotated[float, Field(gt=0.0, le=500.0), Quantity("N")]
    """Largest estimated external force at the TCP, N."""
    low: Annotated[Point, Quantity("m")]
    """Lower corner of the permitted workspace of the TCP, m, base frame."""
    high: Annotated[Point, Quantity("m")]
    """Upper corner of the permitted workspace of the TCP, m, base frame."""
