"""Hours of mixed commands on one served cell: growth of its memory, handles and threads."""

import csv
import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from cell.config.load import LoadedConfig
from cell.lab.faults import devices
from cell.lab.faults.bench import CYCLE, LONGEST, WAITING, FaultBench, bench
from cell.lab.faults.cases import WENT_ON
from cell.lab.faults.measure import MOMENTS, bring_back
from cell.run.states import State
from drivers.errors import CellError
from plc_bridge.messages import Control, Report
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE

TABLE = "soak.csv"
SAMPLES = 20
"""Number of samples of memory, handles and threads."""
SETTLED = 0.25
"""Share of the time after which caches are filled and growth is measured."""
LATEST = 60
"""Largest PLC cycle number for an event during a run."""
ENDED = tuple(state for state in WAITING if state is not State.HELD)
"""States without a running run."""
_OVER = {Control.HOLD: WAITING, Control.UNHOLD: ENDED, Control.STOP: ENDED, Control.ABORT: ENDED}
"""States in which a control has been executed."""
UNKNOWN_CODE, UNKNOWN_RECIPE = 9999, 999
_INSERT, _GRASP = CATALOGUE["insert_peg"].code, CATALOGUE["grasp_from_rack"].code


@dataclass(frozen=True, slots=True)
class SoakSample:
    """One sample of the program, after some of the commands."""

    hours: float
    """Simulated time, hours."""
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


Act = Callable[[FaultBench, np.random.Generator], str]
"""Group of commands; returns the ending of its last insertion: result, or reason of the refusal."""


def soak(
    loaded: LoadedConfig, hours: float, seed: int, watch: Callable[[SoakSample], None]
) -> tuple[list[SoakSample], Counter[str]]:
    """Send random commands to one cell for a number of simulated hours; return the samples, and the count of each
    group.

    Raises:
        CellError: The cell cannot be created, or does not answer any more.
    """
    rng, found, acts, endings = np.random.default_rng(seed), list[SoakSample](), Counter[str](), Counter[str]()
    lost_after: list[str] = []
    with bench(loaded) as tested:
        start = tested.cell.clock.now()
        while len(found) < SAMPLES:
            name = str(rng.choice(list(ACTS)))
            acts[name] += 1
            ending = ACTS[name](tested, rng)
            endings[ending] += 1
            if ending not in WENT_ON:
                lost_after.append(f"{name} ({acts.total()}): {ending}")
            passed = (tested.cell.clock.now() - start) / 3600.0
            if passed >= hours * (len(found) + 1) / SAMPLES:
                found.append(_look(passed, endings, lost_after))
                lost_after = []
                watch(found[-1])
    return found, acts


def write(sample: SoakSample, path: Path) -> None:
    """Add a sample to the table on the disk."""
    is_new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        if is_new:
            writer.writerow([field.name for field in fields(SoakSample)])
        writer.writerow(astuple(sample))


def growth(found: Sequence[SoakSample]) -> tuple[float, float, float]:
    """Return the growth of memory, MB, handles and threads per simulated hour, after caches are filled."""
    late = found[int(SETTLED * len(found)) :]
    hours = [sample.hours for sample in late]
    memory, handles, threads = (
        float(np.polyfit(hours, [float(getattr(sample, name)) for sample in late], 1)[0])
        for name in ("memory", "handles", "threads")
    )
    return memory, handles, threads


def _look(hours: float, endings: Counter[str], lost_after: Sequence[str]) -> SoakSample:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    memory = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
    handles = len(list(Path("/proc/self/fd").iterdir()))
    seated, failed = (endings[ending] for ending in WENT_ON)
    total, told = endings.total(), "; ".join(lost_after)
    return SoakSample(
        hours, total, seated, failed, total - seated - failed, told, memory, handles, threading.active_count()
    )


def _inserted(tested: FaultBench) -> str:
    """Insert a peg as an operator does after any event; return the ending."""
    _, _, following = bring_back(tested)
    return following


def _insert(tested: FaultBench, rng: np.random.Generator) -> str:
    return _inserted(tested)


def _interrupted(*controls: Control) -> Act:
    """Return a function that sends these controls during an insertion, each when the cell waits after the previous one."""

    def act(tested: FaultBench, rng: np.random.Generator) -> str:
        tested.peer.trigger(_INSERT)
        _cycles(tested, lambda report: False, int(rng.integers(1, LATEST)))
        for control in controls:
            tested.peer.trigger(control)
            _cycles(tested, _is_in(_OVER[control]))
        tested.peer.acknowledge()
        return _inserted(tested)

    return act


def _is_in(states: Sequence[State]) -> Callable[[Report], bool]:
    return lambda report: report.state in states


def _cycles(tested: FaultBench, is_over: Callable[[Report], bool], most: int = round(LONGEST / CYCLE)) -> None:
    """Run the PLC's cycles until a condition holds, up to a maximum number."""
    for _ in range(most):
        if is_over(tested.peer.cycle()):
            return
        time.sleep(CYCLE)


def _refused(tested: FaultBench, rng: np.random.Generator) -> str:
    for code, recipe in ((UNKNOWN_CODE, 0), (_INSERT, UNKNOWN_RECIPE)):
        tested.peer.run(code, recipe, timeout=LONGEST)
    return _inserted(tested)


def _by_hand(tested: FaultBench, rng: np.random.Generator) -> str:
    for code in (_GRASP, CATALOGUE["recover"].code, Control.CLEARED, Control.REFILLED):
        tested.peer.run(code, timeout=LONGEST)
    return _inserted(tested)


def _connected_anew(tested: FaultBench, rng: np.random.Generator) -> str:
    tested.connect()
    onlooker = Peer(*tested.bridge.address)
    onlooker.look()
    onlooker.close()
    return _inserted(tested)


def _asked(tested: FaultBench, rng: np.random.Generator) -> str:
    tested.journal.runs(50)
    tested.peer.read_diagnostics()
    return _inserted(tested)


def _reflex(tested: FaultBench, rng: np.random.Generator) -> str:
    stage = str(rng.choice(list(MOMENTS)))
    tested.arm_fault(stage, float(rng.uniform(0.0, 1.0)), lambda: setattr(tested.arm, "change", devices.reflex))
    try:
        tested.run(_INSERT)
    except CellError as error:
        return f"{type(error).__name__}: {error}"
    finally:
        tested.arm.change, tested.stage = (lambda state: state), 0
    return _inserted(tested)


ACTS: dict[str, Act] = {
    "insert": _insert,
    "hold, unhold": _interrupted(Control.HOLD, Control.UNHOLD),
    "stop": _interrupted(Control.STOP),
    "abort": _interrupted(Control.ABORT),
    "refused": _refused,
    "by hand": _by_hand,
    "connect anew": _connected_anew,
    "ask the records": _asked,
    "reflex of the arm": _reflex,
}
"""Groups of commands; each ends with an insertion."""
