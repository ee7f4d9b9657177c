"""Pace of a plan: one factor on all of its speeds and waiting times, capped by the arm's limits; pure."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

from pydantic.fields import FieldInfo

from drivers.config_model import ConfigModel, Quantity, Tempo

P = TypeVar("P", bound=ConfigModel)


@dataclass(frozen=True, slots=True)
class Pace:
    """Factor on the speeds of a plan, and the limits of the arm that performs it."""

    scale: float = 1.0
    """Key `speed_scale`: factor on every speed, and divisor of every waiting time, ratio."""
    speed: float = math.inf
    """Largest speed of the tool, m/s."""
    turn_speed: float = math.inf
    """Largest turning rate of the tool, rad/s."""

    def most(self, quantity: Quantity, radius: float) -> float:
        """Return the largest value of a speed; `radius` is that of the circle that a rate turns on, m, 0 without one."""
        if quantity.unit == "m/s":
            return self.speed
        if quantity.unit == "rad/s":
            return self.speed / radius if radius > 0.0 else self.turn_speed
        return math.inf


@dataclass(frozen=True, slots=True)
class Capped:
    """A speed that the arm's limits reduce."""

    name: str
    """Name of the figure with its sections."""
    asked: float
    """Speed without the limit, in the figure's unit."""
    speed: float
    """Speed in force, in the figure's unit."""


def at_pace(params: P, pace: Pace) -> P:
    """Return parameters with every speed multiplied by the pace's scale, and every waiting time divided by it.

    The arm's limits cap the speeds. The longest times of motions grow in a slower plan, and stay in a faster one.
    """
    return _paced(params, pace, "", [])


def capped(params: ConfigModel, pace: Pace, name: str) -> list[Capped]:
    """Return the speeds that the arm's limits reduce; `name` is that of the section."""
    found: list[Capped] = []
    _paced(params, pace, f"{name}.", found)
    return found


def _paced(params: P, pace: Pace, place: str, found: list[Capped]) -> P:
    changes: dict[str, object] = {}
    for name, field in type(params).model_fields.items():
        value = getattr(params, name)
        if isinstance(value, ConfigModel):
            changes[name] = _paced(value, pace, f"{place}{name}.", found)
        for quantity in (mark for mark in _marks(field) if mark.tempo is not None):
            radius = getattr(params, quantity.radius) if quantity.radius else 0.0
            changes[name] = now = _changed(value, quantity, radius, pace)
            if quantity.tempo is Tempo.SPEED and now < pace.scale * value:
                found.append(Capped(f"{place}{name}", pace.scale * value, now))
    return params.model_copy(update=changes) if changes else params


def _changed(value: float, quantity: Quantity, radius: float, pace: Pace) -> float:
    """Return the value of a figure in a plan at this pace; `radius` as for `Pace.most`."""
    if quantity.tempo is Tempo.SPEED:
        return min(pace.scale * value, pace.most(quantity, radius))
    if quantity.tempo is Tempo.WAIT:
        return value / pace.scale
    if quantity.tempo is Tempo.LIMIT:
        return value / min(pace.scale, 1.0)
    return value


def _marks(field: FieldInfo) -> Iterator[Quantity]:
    return (mark for mark in field.metadata if isinstance(mark, Quantity))
