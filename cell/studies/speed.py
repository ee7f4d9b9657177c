"""How fast the stand-in runs, free space and contact apart, and what of that is spent outside `mj_step`."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from cell.assembly import assemble, opened
from cell.config import CellConfig
from drivers.quantities import ImpedanceSetpoint, Vector
from sim.engine import bare
from sim.world import World
from skills.catalogue import insert_peg
from skills.contract import Observation

REPLAYED = 20
"""Bare steps taken from every state that is kept."""
KEEP_EVERY = 3
"""Scans between the states that are kept."""


class Regime(Enum):
    """What the held peg does."""

    FREE = "free space"
    CONTACT = "contact"


@dataclass(frozen=True, slots=True)
class SpeedLine:
    """One regime of one whole trial."""

    regime: str
    simulated: float
    """s."""
    real_time: float
    """Multiples of real time; control, skin, skills and records included."""
    bare_rate: float
    """Of bare `mj_step`, same scene, same states, same run, steps/s."""
    outside: float
    """Wall time outside `mj_step` for one simulated ms, s."""


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    model: Any
    data: Any
    q: Vector
    v: Vector
    force: Vector
    warm: Vector


class _Book:
    """Books every scan's wall time where the peg is, and keeps states to step again."""

    def __init__(self, world: World) -> None:
        self._world, self._scans, self._since, self._from = world, 0, time.perf_counter(), world.now()
        self.spent = dict.fromkeys(Regime, 0.0)
        self.simulated = dict.fromkeys(Regime, 0.0)
        self.states: dict[Regime, list[_State]] = {regime: [] for regime in Regime}

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Book the time since the last scan."""
        now, world = time.perf_counter(), self._world
        regime = Regime.CONTACT if world.contact_force().any() else Regime.FREE
        self.spent[regime] += now - self._since
        self.simulated[regime] += seen.stamp - self._from
        self._scans += 1
        if self._scans % KEEP_EVERY == 0:
            model, data = world.physics()
            copies = (
                np.array(data.qpos),
                np.array(data.qvel),
                np.array(data.qfrc_applied),
                np.array(data.qacc_warmstart),
            )
            self.states[regime].append(_State(model, data, *copies))
        self._since, self._from = time.perf_counter(), seen.stamp


def measure(config: CellConfig, seed: int) -> list[SpeedLine]:
    """Run one whole trial on one core and take it apart.

    Args:
        config: A simulated cell at pace "max".
        seed: Of the trial; it runs twice, so that nothing is compiled while the clock runs.
    """
    assert config.sim is not None
    _trial(config, seed)
    book = _trial(config, seed)
    lines = []
    for regime in Regime:
        step = _seconds_a_step(book.states[regime])
        lines.append(
            SpeedLine(
                regime.value,
                book.simulated[regime],
                book.simulated[regime] / book.spent[regime],
                1.0 / step,
                book.spent[regime] / (book.simulated[regime] * 1e3) - step * 1e-3 / config.sim.timestep,
            )
        )
    return lines


def _trial(config: CellConfig, seed: int) -> _Book:
    with opened(assemble(config)) as cell:
        assert isinstance(cell.clock, World)
        cell.restock(config.job(), seed)
        ctx, book = cell.context(seed), _Book(cell.clock)
        ctx.record = book.record
        insert_peg(config.skill_set(), ctx)
        return book


def _seconds_a_step(states: Sequence[_State]) -> float:
    """Return the wall time of one bare `mj_step`, the mean over what follows each state."""
    # Once before the clock runs: the first call loads or compiles.
    bare(states[0].model._address, states[0].data._address, 1)
    started = time.perf_counter()
    for state in states:
        data = state.data
        data.qpos[:], data.qvel[:], data.qfrc_applied[:], data.qacc_warmstart[:] = (
            state.q,
            state.v,
            state.force,
            state.warm,
        )
        bare(state.model._address, state.data._address, REPLAYED)
    return (time.perf_counter() - started) / (REPLAYED * len(states))
