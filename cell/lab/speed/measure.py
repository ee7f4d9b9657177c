"""Speed of the simulation in each regime, the share of it that is spent outside `mj_step`, and a profile."""

import cProfile
import pstats
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from cell.assembly import assemble, opened
from cell.cell_config import CellConfig
from drivers.quantities import ImpedanceSetpoint, Vector
from sim import engine, native
from sim.world import World
from skills.catalogue import insert_peg
from skills.contract import Observation

REPEATS = 3
"""Number of whole trials; the fastest counts, because other programs only ever slow a run."""
REPLAYS = 3
"""Number of replays of a trial's steps; the fastest counts."""
TOUCHED = 1e-3
"""Net force of the plates on the held peg, low-passed, above which it counts as in contact, N."""
STAGES = {
    "mj_step: kinematics": ("POS_KINEMATICS",),
    "mj_step: inertia": ("POS_INERTIA",),
    "mj_step: contacts": ("POS_COLLISION",),
    "mj_step: constraint rows": ("POS_MAKE", "POS_PROJECT"),
    "mj_step: velocities": ("VELOCITY",),
    "mj_step: solver": ("CONSTRAINT",),
}
"""Stages of MuJoCo's own timers; the rest of a step is integration and overhead."""


class Regime(Enum):
    """Regime of a scan, by what the hand does."""

    GRASP = "hand empty, grasp, release"
    FREE = "held, free space"
    CONTACT = "held, contact"


WHOLE = "whole trial"
SMALL = 0.01
"""Share of the whole below which parts are summed up in one line."""


@dataclass(frozen=True, slots=True)
class SpeedLine:
    """One regime of one whole trial."""

    regime: str
    simulated: float
    """Simulated time, s."""
    real_time: float
    """Seconds simulated in a second of one core; control, skin, skills and records included."""
    bare_rate: float
    """Rate of bare `mj_step` in the same scene and states of the same run, steps/s."""
    bare_real_time: float
    """Seconds that bare `mj_step` would simulate in a second."""
    outside: float
    """Core time outside `mj_step` for one simulated ms, s."""


@dataclass(frozen=True, slots=True)
class ProfileLine:
    """Cost of one part of a whole trial."""

    part: str
    cost: float
    """Core time for one simulated ms, s."""
    share: float
    """Share of the whole, fraction."""


class _Book:
    """Books every scan's time to its regime, and keeps the states to step from again."""

    def __init__(self, world: World) -> None:
        self._world, self._since, self._from = world, time.thread_time(), world.now()
        self.spent = dict.fromkeys(Regime, 0.0)
        self.simulated = dict.fromkeys(Regime, 0.0)
        self.states: dict[Regime, dict[int, tuple[Any, Any, list[Vector]]]] = {regime: {} for regime in Regime}

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Book the time since the last scan."""
        now, world = time.thread_time(), self._world
        model, data = world.physics()
        force = world.contact_force()
        regime = Regime.CONTACT if float(force @ force) > TOUCHED**2 else Regime.FREE
        if not world.is_held:
            regime = Regime.GRASP
        self.spent[regime] += now - self._since
        self.simulated[regime] += seen.stamp - self._from
        states = self.states[regime].setdefault(model._address, (model, data, []))[2]
        states.append(np.concatenate(_views(model, data)))
        self._since, self._from = time.thread_time(), seen.stamp

    @property
    def total(self) -> float:
        """Core time of all scans, s."""
        return sum(self.spent.values())

    def cost(self, regime: Regime) -> tuple[float, float]:
        """Return the core time of one bare step, s, and the number of steps in a simulated ms; means over the scans."""
        seconds = steps = scans = 0.0
        for model, data, states in self.states[regime].values():
            # The law sets the torque once for the two steps after a scan, so that these are the trial's own steps.
            took = min(_replay(model, data, states, 2) for _ in range(REPLAYS)) / (2 * len(states))
            rate = 1e-3 / model.opt.timestep * len(states)
            seconds, steps, scans = seconds + took * rate, steps + rate, scans + len(states)
        return (seconds / steps, steps / scans) if scans else (0.0, 0.0)


def measure(config: CellConfig, seed: int) -> list[SpeedLine]:
    """Run one whole trial on one core and measure its regimes.

    Args:
        config: A simulated cell at pace "max".
        seed: Seed of the trial; it is run several times, once beforehand so that nothing is compiled while the clock runs.
    """
    return _lines(_fastest(config, seed))


def profile(config: CellConfig, seed: int) -> list[ProfileLine]:
    """Share out the time of one whole trial; arguments as of `measure`.

    `mj_step` is divided by MuJoCo's own timers, the time outside the compiled loop by Python's profiler. Both slow what
    they watch, so that they only share out the time measured without them.
    """
    book = _fastest(config, seed)
    bare, stages = 0.0, dict.fromkeys(STAGES, 0.0)
    for regime in Regime:
        seconds, steps = book.cost(regime)
        cost = seconds * steps * book.simulated[regime] * 1e3
        bare += cost
        for name, share in _stages(book, regime).items():
            stages[name] += cost * share
    watch = cProfile.Profile(time.thread_time)
    watch.enable()
    _trial(config, seed)
    watch.disable()
    loop, packages = 0.0, dict[str, float]()
    for (file, _, name), (_, _, own, _, _) in pstats.Stats(watch).stats.items():  # type: ignore[attr-defined]
        if name == "advance" and file.endswith("engine.py"):
            loop += own
        else:
            packages[_package(file)] = packages.get(_package(file), 0.0) + own
    scale = max(book.total - loop, 0.0) / sum(packages.values())
    small = [name for name, own in packages.items() if own * scale < SMALL * book.total]
    packages["the rest"] = sum(packages.pop(name) for name in small)
    parts = {
        **stages,
        "mj_step: integration and the rest": bare - sum(stages.values()),
        "torque law, meters": loop - bare,
        **{f"Python: {name}": own * scale for name, own in sorted(packages.items(), key=lambda item: -item[1])},
    }
    simulated = 1e3 * sum(book.simulated.values())
    return [ProfileLine(part, cost / simulated, cost / book.total) for part, cost in parts.items()]


def _lines(book: _Book) -> list[SpeedLine]:
    lines, bare, count = [], 0.0, 0.0
    for regime in Regime:
        seconds, steps = book.cost(regime)
        simulated = book.simulated[regime]
        if simulated == 0.0:
            continue
        bare += seconds * steps * simulated * 1e3
        count += steps * simulated * 1e3
        lines.append(_line(regime.value, simulated, book.spent[regime], seconds, steps))
    simulated = sum(book.simulated.values())
    return [*lines, _line(WHOLE, simulated, book.total, bare / count, count / (simulated * 1e3))]


def _line(name: str, simulated: float, spent: float, seconds: float, steps: float) -> SpeedLine:
    bare = seconds * steps
    return SpeedLine(name, simulated, simulated / spent, 1.0 / seconds, 1e-3 / bare, spent / (simulated * 1e3) - bare)


def _fastest(config: CellConfig, seed: int) -> _Book:
    _trial(config, seed)
    return min((_trial(config, seed) for _ in range(REPEATS)), key=lambda book: book.total)


def _trial(config: CellConfig, seed: int) -> _Book:
    # Late scans would be counted as time of the physics.
    config = config.model_copy(update={"reality": config.reality.model_copy(update={"scale": 0.0})})
    with opened(assemble(config)) as cell:
        assert isinstance(cell.clock, World)
        cell.clear()
        cell.restock(config.job(), seed)
        ctx, book = cell.context(seed), _Book(cell.clock)
        ctx.record = book.record
        insert_peg(config.skill_set(), ctx)
        return book


def _replay(model: Any, data: Any, states: Sequence[Vector], steps: int) -> float:
    """Return the time of the core that bare steps from these states take, s."""
    views = _views(model, data)
    stacked = np.array(states)
    # The first call loads or compiles and must not be timed.
    engine.replay(model._address, data._address, views, stacked[:1], 1)
    started = time.thread_time()
    engine.replay(model._address, data._address, views, stacked, steps)
    return time.thread_time() - started


def _views(model: Any, data: Any) -> tuple[Vector, ...]:
    """Return views of everything in a state that a step depends on and that changes in a trial."""
    return (data.qpos, data.qvel, data.qfrc_applied, data.qacc_warmstart, model.dof_frictionloss)


def _stages(book: _Book, regime: Regime) -> dict[str, float]:
    """Return the share of each stage of `mj_step`, by MuJoCo's own timers."""
    spent, whole = dict.fromkeys(STAGES, 0.0), 0.0
    for model, data, states in book.states[regime].values():
        native.stage_times(data)
        with native.clocked():
            _replay(model, data, states, 2)
        times = native.stage_times(data)
        for name, timers in STAGES.items():
            spent[name] += sum(times[timer] for timer in timers)
        whole += times["STEP"]
    return {name: value / whole if whole else 0.0 for name, value in spent.items()}


def _package(file: str) -> str:
    path = Path(file)
    root = Path(__file__).parents[2]
    if path.is_relative_to(root) and not any(part in path.parts for part in ("site-packages", ".venv")):
        return "/".join(path.relative_to(root).with_suffix("").parts[:2])
    return "numpy and built-in functions"
