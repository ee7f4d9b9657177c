"""Hours of mixed commands on one served cell, in pieces: growth of its memory, handles and threads."""

import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby
from pathlib import Path

import numpy as np

from cell.config.load import LoadedConfig
from cell.lab.faults.bench import CYCLE, WAITING, FaultBench, bench
from cell.lab.faults.cases import INSERT, LONGEST, RECOVER, STAGES, WENT_ON
from cell.lab.faults.devices import ARM
from cell.lab.faults.measure import bring_back
from cell.lab.rows import kept_rows
from cell.records.provenance import versions
from cell.records.wall_clock import now_text
from cell.run.states import State
from drivers.errors import CellError, ConfigError
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Control, Report
from skills.catalogue import CATALOGUE

TABLE = "soak.csv"
SETTLED = 0.25
"""Share of a piece after which caches are filled and growth is measured, fraction."""
LATEST = 60
"""Upper limit of the PLC cycles from the start of a run to the first control, exclusive."""
ENDED = tuple(state for state in WAITING if state is not State.HELD)
"""States in which no run is in progress or on hold."""
OVER = {Control.HOLD: WAITING, Control.UNHOLD: ENDED, Control.STOP: ENDED, Control.ABORT: ENDED}
"""States that show that a control has been executed, by the control."""
UNKNOWN_CODE, UNKNOWN_RECIPE = 9999, 999


@dataclass(frozen=True, slots=True)
class SoakGroup:
    """One group of commands, and the state of the program after it."""

    piece: int
    code: str
    """Fingerprint of the program's code."""
    began: str
    """Start of the piece, ISO 8601."""
    wall: float
    """Wall time since the start of the piece, hours."""
    hours: float
    """Simulated time since the start of the piece, hours."""
    name: str
    ending: str
    """Result of the insertion after the commands; if it is not one of `WENT_ON`, the cell did not insert again."""
    memory: float
    """Memory of the program, MB."""
    handles: int
    """Number of open files, sockets and terminals."""
    threads: int


@dataclass(frozen=True, slots=True)
class Piece:
    """One piece of the soak test; memory (MB), handles and threads are the growth per simulated hour, after caches are filled."""

    piece: int
    began: str
    gap: float
    """Time since the end of the piece before, hours; 0 for the first."""
    wall: float
    hours: float
    groups: int
    seated: int
    failed: int
    lost: int
    """Number of groups after which the cell did not insert again."""
    memory: float
    handles: float
    threads: float


Act = Callable[[FaultBench, np.random.Generator], object]
"""Group of commands before an insertion."""


def earlier(path: Path) -> list[SoakGroup]:
    """Return the groups of earlier pieces.

    Raises:
        ConfigError: Other code than the present one wrote the groups.
    """
    rows, code = kept_rows(SoakGroup, path), versions()["code"]
    if any(row.code != code for row in rows):
        raise ConfigError(f"{path}: pieces of other code, {rows[0].code} instead of {code}; another --out needed")
    return rows


def soak(loaded: LoadedConfig, piece: int, hours: float, seed: int) -> Iterator[SoakGroup]:
    """Send random groups of commands to one cell for `hours` of simulated time, and yield each group when it has ended.

    Raises:
        CellError: The cell cannot be created, or does not answer any more.
    """
    rng, began, wall, passed = np.random.default_rng((seed, piece)), now_text(), time.monotonic(), 0.0
    with bench(loaded) as tested:
        start = tested.cell.clock.now()
        while passed < hours:
            name = str(rng.choice(list(ACTS)))
            ending = _ending(tested, ACTS[name], rng)
            passed = (tested.cell.clock.now() - start) / 3600.0
            yield SoakGroup(
                piece=piece,
                code=versions()["code"],
                began=began,
                wall=(time.monotonic() - wall) / 3600.0,
                hours=passed,
                name=name,
                ending=ending,
                memory=int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6,
                handles=len(list(Path("/proc/self/fd").iterdir())),
                threads=threading.active_count(),
            )


def pieces(rows: Sequence[SoakGroup]) -> list[Piece]:
    """Return one line per piece, with the gap before it."""
    found, ended = list[Piece](), None
    for number, rows_of_it in groupby(rows, key=lambda row: row.piece):
        groups = list(rows_of_it)
        last, began = groups[-1], datetime.fromisoformat(groups[0].began).timestamp() / 3600.0
        gap = 0.0 if ended is None else began - ended
        ended = began + last.wall
        endings = Counter(group.ending for group in groups)
        seated, failed = (endings[each] for each in WENT_ON)
        counts = len(groups), seated, failed, len(groups) - seated - failed
        found.append(Piece(number, last.began, gap, last.wall, last.hours, *counts, *growth(groups)))
    return found


def growth(found: Sequence[SoakGroup]) -> tuple[float, float, float]:
    """Return the growth of memory, MB, handles and threads per simulated hour, after caches are filled."""
    late = found[int(SETTLED * len(found)) :]
    if len(late) < 2:
        return 0.0, 0.0, 0.0
    hours = [group.hours for group in late]
    counts = [(group.memory, float(group.handles), float(group.threads)) for group in late]
    memory, handles, threads = np.polyfit(hours, counts, 1)[0].tolist()
    return memory, handles, threads


def _ending(tested: FaultBench, act: Act, rng: np.random.Generator) -> str:
    """Execute a group, then insert a peg as an operator does after any event; return the ending."""
    try:
        act(tested, rng)
    except CellError as error:
        return f"{type(error).__name__}: {error}"
    return bring_back(tested)[2]


def _interrupted(*controls: Control) -> Act:
    """Return a function that sends these controls during an insertion, each after the cell has executed the previous one."""

    def act(tested: FaultBench, rng: np.random.Generator) -> None:
        tested.peer.trigger(INSERT)
        _cycles(tested, lambda report: False, int(rng.integers(1, LATEST)))
        for control in controls:
            tested.peer.trigger(control)
            _cycles(tested, lambda report, control=control: report.state in OVER[control])  # type: ignore[misc]
        tested.peer.acknowledge()

    return act


def _cycles(tested: FaultBench, is_over: Callable[[Report], bool], most: int = round(LONGEST / CYCLE)) -> None:
    """Run the PLC's cycles until a condition holds, up to a maximum number."""
    for _ in range(most):
        if is_over(tested.peer.cycle()):
            return
        time.sleep(CYCLE)


def _commanded(*commands: tuple[int, int]) -> Act:
    """Return a function that sends these commands and recipes, one after the other."""
    return lambda tested, rng: [tested.peer.run(code, recipe, timeout=LONGEST) for code, recipe in commands]


def _connected_anew(tested: FaultBench, rng: np.random.Generator) -> None:
    tested.connect()
    onlooker = Peer(*tested.bridge.address)
    onlooker.look()
    onlooker.close()


def _asked(tested: FaultBench, rng: np.random.Generator) -> None:
    tested.journal.runs(50)
    tested.peer.read_diagnostics()


def _reflex(tested: FaultBench, rng: np.random.Generator) -> None:
    stage, moment = str(rng.choice(list(STAGES))), float(rng.uniform(0.0, 1.0))
    tested.arm_fault(stage, moment, lambda: setattr(tested.arm, "change", ARM["reflex"]()))
    try:
        tested.run(INSERT)
    finally:
        tested.arm.change, tested.stage = (lambda state: state), 0


ACTS: dict[str, Act] = {
    "insert": lambda tested, rng: None,
    "hold, unhold": _interrupted(Control.HOLD, Control.UNHOLD),
    "stop": _interrupted(Control.STOP),
    "abort": _interrupted(Control.ABORT),
    "refused": _commanded((UNKNOWN_CODE, 0), (INSERT, UNKNOWN_RECIPE)),
    "by hand": _commanded(
        (CATALOGUE["grasp_from_rack"].code, 0), (RECOVER, 0), (Control.CLEARED, 0), (Control.REFILLED, 0)
    ),
    "connect anew": _connected_anew,
    "ask the records": _asked,
    "reflex of the arm": _reflex,
}
"""Groups of commands; each is followed by an insertion."""
