"""Pace of a plan: one factor on all of its speeds and waiting times, capped by the arm's limits; pure."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

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
        """Return the arm's limit of a speed or rate; a rate on a circle of `radius`, m, is limited by the speed on the circle."""
        if quantity.unit == "m/s":
            return self.speed
        if quantity.unit == "rad/s":
            return self.speed / radius if radius > 0.0 else self.turn_speed
        return math.inf


def at_pace(params: P, pace: Pace) -> P:
    """Return parameters at a pace: scaled, and within the arm's limits."""
    return within(scaled(params, pace.scale), pace)


def scaled(params: P, scale: float) -> P:
    """Return parameters with every speed multiplied by `scale`, and every waiting time divided by it.

    If `scale` is below 1, the time limits of motions are also divided by it; a faster plan keeps them.
    """
    if scale == 1.0:
        return params
    factors = {Tempo.SPEED: scale, Tempo.WAIT: 1.0 / scale, Tempo.LIMIT: 1.0 / min(scale, 1.0)}
    return _changed(params, lambda mark, value, _: value * factors[mark.tempo] if mark.tempo is not None else value)


def within(params: P, pace: Pace) -> P:
    """Return parameters whose speeds are within the arm's limits."""
    return _changed(
        params,
        lambda mark, value, radius: min(value, pace.most(mark, radius)) if mark.tempo is Tempo.SPEED else value,
    )


def _changed(params: P, change: Callable[[Quantity, float, float], float]) -> P:
    """Return parameters with every speed, wait and time limit replaced by `change(mark, value, radius named by the mark)`."""
    changes: dict[str, object] = {}
    for name, value in vars(params).items():
        if isinstance(value, ConfigModel) and (inner := _changed(value, change)) is not value:
            changes[name] = inner
    for name, mark in _with_tempo(type(params)):
        value, radius = getattr(params, name), getattr(params, mark.radius) if mark.radius else 0.0
        if (after := change(mark, value, radius)) != value:
            changes[name] = after
    return params.model_copy(update=changes) if changes else params


@cache
def _with_tempo(kind: type[ConfigModel]) -> tuple[tuple[str, Quantity], ...]:
    """Return the names and marks of the figures that have a tempo."""
    marks = ((name, mark) for name, field in kind.model_fields.items() for mark in field.metadata)
    return tuple((name, mark) for name, mark in marks if isinstance(mark, Quantity) and mark.tempo is not None)
