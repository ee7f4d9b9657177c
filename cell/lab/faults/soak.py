"""Hours of mixed commands on one served cell: growth of its memory, handles and threads."""

import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.config.load import LoadedConfig
from cell.lab.faults.bench import CYCLE, WAITING, FaultBench, bench
from cell.lab.faults.cases import INSERT, LONGEST, RECOVER, STAGES, WENT_ON
from cell.lab.faults.devices import ARM
from cell.lab.faults.measure import bring_back
from cell.run.states import State
from drivers.errors import CellError
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Control, Report
from skills.catalogue import CATALOGUE

TABLE = "soak.csv"
SAMPLES = 20
"""Number of samples of memory, handles and threads."""
SETTLED = 0.25
"""Share of the samples after which caches are filled and growth is measured."""
LATEST = 60
"""Largest PLC cycle number for an event during a run."""
ENDED = tuple(state for state in WAITING if state is not State.HELD)
"""States without a running run."""
OVER = {Control.HOLD: WAITING, Control.UNHOLD: ENDED, Control.STOP: ENDED, Control.ABORT: ENDED}
"""States in which a control has been executed."""
UNKNOWN_CODE, UNKNOWN_RECIPE = 9999, 999


@dataclass(frozen=True, slots=True)
class SoakSample:
    """One sample of the program, after some of the commands."""

    wall: float
    """Time since the start, hours."""
    hours: float
    """Simulated time since the start, hours."""
    commands: int
    """Number of command groups up to this sample."""
    seated: int
    """Number of groups whose last insertion was a success."""
    failed: int
    """Number of groups that ended in a failure, after which production continues."""
    lost: int
    """Number of groups after which the cell did not insert again."""
    lost_after: str
    """Lost groups since the previous sample, each with its number and the ending of its last insertion."""
    memory: float
    """Memory of the program, MB."""
    handles: int
    """Number of open files, sockets and terminals."""
    threads: int


Act = Callable[[FaultBench, np.random.Generator], object]
"""Group of commands before an insertion."""


def soak(loaded: LoadedConfig, hours: float, seed: int) -> Iterator[SoakSample]:
    """Send random commands to one cell for a number of simulated hours, and yield samples of the program.

    Raises:
        CellError: The cell cannot be created, or does not answer any more.
    """
    rng, endings, lost_after = np.random.default_rng(seed), Counter[str](), list[str]()
    wall, samples = time.monotonic(), 0
    with bench(loaded) as tested:
        start = tested.cell.clock.now()
        while samples < SAMPLES:
            name = str(rng.choice(list(ACTS)))
            ending = _ending(tested, ACTS[name], rng)
            endings[ending] += 1
            if ending not in WENT_ON:
                lost_after.append(f"{name} ({endings.total()}): {ending}")
            passed = (tested.cell.clock.now() - start) / 3600.0
            if passed < hours * (samples + 1) / SAMPLES:
                continue
            samples += 1
            seated, failed = (endings[each] for each in WENT_ON)
            yield SoakSample(
                wall=(time.monotonic() - wall) / 3600.0,
                hours=passed,
                commands=endings.total(),
                seated=seated,
                failed=failed,
                lost=endings.total() - seated - failed,
                lost_after="; ".join(lost_after),
                memory=int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6,
                handles=len(list(Path("/proc/self/fd").iterdir())),
                threads=threading.active_count(),
            )
            lost_after = []


def growth(found: Sequence[SoakSample]) -> dict[str, float]:
    """Return the growth of memory, MB, handles and threads per simulated hour, after caches are filled."""
    late = found[int(SETTLED * len(found)) :]
    hours = [sample.hours for sample in late]
    counts = [(sample.memory, float(sample.handles), float(sample.threads)) for sample in late]
    return dict(zip(("memory", "handles", "threads"), np.polyfit(hours, counts, 1)[0].tolist(), strict=True))


def _ending(tested: FaultBench, act: Act, rng: np.random.Generator) -> str:
    """Execute a group, then insert a peg as an operator does after any event; return the ending."""
    try:
        act(tested, rng)
    except CellError as error:
        return f"{type(error).__name__}: {error}"
    return bring_back(tested)[2]


def _interrupted(*controls: Control) -> Act:
    """Return a function that sends these controls during an insertion, each when the cell waits after the previous one."""

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
