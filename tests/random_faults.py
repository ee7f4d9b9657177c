"""Faults of devices that no table lists: a random part of a reading or a command is wrong by a random amount at random times.

    python -m tests.random_faults [--cases 60] [--seed 1]

draws that many, causes each during an insertion as `cell study faults` does, and prints the same columns. A call that
was broken off goes on where it was.
"""

import argparse
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cell.config.load import load
from cell.lab.faults import tables
from cell.lab.faults.bench import KEYS, FaultBench
from cell.lab.faults.cases import STAGES, TABLE, Planned, begun
from cell.lab.faults.contract import FaultKind, Undo
from cell.lab.faults.measure import measure
from cell.lab.rows import write_rows
from drivers.quantities import SwitchState
from sim.boards.faulty import Change

FOLDER = Path("build/random_faults")
NUMBERS = {
    "arm q": 0.05,
    "arm dq": 0.2,
    "arm tcp.position": 0.005,
    "arm wrench.force": 8.0,
    "arm wrench.torque": 1.0,
    "arm setpoint_age": 0.05,
    "gripper width": 0.005,
    "wire taxels": 3000.0,
    "arm follow tip": 0.003,
    "gripper grip": 10.0,
}
"""Numbers that a device reports or is commanded, and the scale of their errors, in their own units."""
STATES: dict[str, Change] = {
    "gripper is_gripping": lambda value: not value,
    "gripper is_moving": lambda value: not value,
    "switch": lambda state: SwitchState.CLOSED if state is SwitchState.OPEN else SwitchState.OPEN,
}
"""States that a device reports, and what they change to."""


@dataclass
class Commanded:
    """A device that gets one of its commands changed."""

    device: Any
    command: str
    change: Change

    def __getattr__(self, name: str) -> Any:
        sent = getattr(self.device, name)
        return (lambda value: sent(self.change(value))) if name == self.command else sent


def within(path: str, change: Change) -> Change:
    """Return the change of a value for that of the field of it that a path names."""
    name, _, rest = path.partition(".")
    if not name:
        return change
    inner = within(rest, change)
    return lambda value: replace(value, **{name: inner(getattr(value, name))})


def wrong_number(scale: float, rng: np.random.Generator) -> tuple[str, Change]:
    """Return a random error of one number, or of some of an array, and its name."""
    error, share = float(scale * rng.normal() * 2.0 ** rng.uniform(-2.0, 1.0)), float(rng.choice([0.0, 0.3, 1.0]))
    factor, seed = float(rng.choice([-1.0, 0.0, 0.3, 0.8, 1.2, 3.0])), int(rng.integers(2**31))
    kept: list[Any] = []

    def still(value: Any) -> Any:
        kept.append(value)
        return kept[0]

    noise = np.random.default_rng(seed)
    errors: list[tuple[str, Change]] = [
        (f"{error:+.3g}", lambda value: value + error),
        (f"times {factor:g}", lambda value: value * factor),
        ("still", still),
        (f"noise {error:.3g}", lambda value: value + error * noise.normal(size=np.shape(value))),
        (f"in steps of {abs(error):.3g}", lambda value: np.round(value / error) * error),
    ]
    name, edit = errors[rng.integers(len(errors))]

    def change(value: Any) -> Any:
        array = np.asarray(value)
        chosen = np.random.default_rng(seed).random(array.shape) <= share
        chosen.flat[seed % max(array.size, 1)] = True
        wrong = np.where(chosen, edit(array.astype(float)), array)
        if array.dtype.kind in "iu":
            wrong = np.clip(wrong, 0, np.iinfo(array.dtype).max)
        return wrong.astype(array.dtype) if array.ndim else float(wrong)

    return f"{name} in {share:.0%}" if share else name, change


def at_times(change: Change, rng: np.random.Generator, longest: float) -> tuple[str, Change]:
    """Return the change at random ones of the readings, for up to a number of them in a row, and the name of these times."""
    every, most = int(rng.integers(2, 30)), int(longest ** rng.uniform(0.0, 1.0))
    draw = np.random.default_rng(int(rng.integers(2**31)))
    times: list[tuple[str, Change]] = [
        (f"for {most} readings", lambda number: number < most),
        (f"every {every}", lambda number: number % every == 0),
        (f"in bursts of {every}", lambda number: number // every % 2 == 0),
        (f"in one of {every}", lambda number: draw.random() * every < 1.0),
    ]
    name, is_due = times[rng.integers(len(times))]
    numbers = iter(range(10**9))
    return name, lambda value: change(value) if is_due(next(numbers)) else value


def begin(what: str, change: Change, bench: FaultBench) -> Undo:
    """Cause a fault, and return its repair."""
    device, _, path = what.partition(" ")
    command, _, field = path.partition(" ")
    if device == "wire":
        hub = bench.wire.board.hub  # type: ignore[attr-defined]
        measured = hub.measure
        hub.measure = lambda: change(measured())
        return lambda: setattr(hub, "measure", measured)
    faulty = getattr(bench, device)
    if command in ("follow", "grip"):
        faulty.device = Commanded(faulty.device, command, within(field, change))
        return lambda: setattr(faulty, "device", faulty.device.device)
    faulty.change = within(path, change)
    return lambda: setattr(faulty, "change", lambda reading: reading)


def drawn(seed: int, number: int) -> Planned:
    """Return one case: its kind, the stage, and the time from the stage's first scan to the fault, s."""
    rng = np.random.default_rng((seed, number))
    what, stage = str(rng.choice([*NUMBERS, *STATES])), str(rng.choice(list(STAGES)))
    how, change = ("other", STATES[what]) if what in STATES else wrong_number(NUMBERS[what], rng)
    when, timed = at_times(change, rng, 1e2 if what in STATES else 1e5)
    moment = round(float(rng.uniform(*STAGES[stage])), 3)
    return FaultKind(f"{what}: {how}, {when}", partial(begin, what, timed)), stage, moment


def main() -> int:
    """Run the cases; return 1 where something happened that never may."""
    parser = argparse.ArgumentParser(description="Random faults of devices.")
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    tried = [drawn(args.seed, number) for number in range(args.cases)]
    rows = begun(tried, FOLDER)

    def make(number: int) -> Any:
        return load(sets=[*KEYS, "sim.pace=max", f"sim.seed={args.seed + number}"])

    for case in measure(make, tried, FOLDER, len(rows)):
        rows.append(case)
        write_rows(rows, FOLDER / TABLE)
    line = tables.lines(rows, make(0).cell.limits.force)[-1]
    sys.stdout.write(", ".join(f"{name} {value}" for name, value in line.items()) + "\n")
    return int(any(line[name] for name in tables.NEVER))


if __name__ == "__main__":
    sys.exit(main())
