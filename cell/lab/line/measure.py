"""Measures of the connection: the cell's server beside a bare one, fifty clients at once, and their effect on the scan.

The cell is the whole product in a separate process, in real time: bridge, supervisor and simulated devices.
"""

import json
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from cell.config.load import LoadedConfig
from cell.lab.line.cell_process import Scan, bare_server, cell_process, patient
from cell.lab.line.client import Address, Load, connected, load, time_requests
from cell.lab.line.plc import Plc, Start
from cell.lab.rows import write_rows
from cell.run.states import State
from drivers.quantities import Vector

CLIENTS, POLL_PERIOD = 50, 0.01
"""Number of clients at once, and time between two requests of one client, s."""
RATIO = 1.3
"""Largest ratio of the median answer time to the bare server's."""


@dataclass(frozen=True, slots=True)
class Effort:
    """Extent of the measurement."""

    rounds: int
    """Number of rounds of reads, alternating between the two servers."""
    reads: int
    """Number of reads in each round."""
    flat_out: int
    """Number of flat-out requests of each of the clients."""
    starts: int
    """Number of commands from Idle to Busy."""
    windows: int
    """Number of pairs of intervals of a run, without clients and with them."""
    window: float
    """Length of such an interval, s."""
    tries: int
    """Number of bursts of each attack."""


FULL = Effort(rounds=50, reads=400, flat_out=400, starts=100, windows=10, window=3.0, tries=100)
QUICK = Effort(rounds=20, reads=100, flat_out=100, starts=25, windows=4, window=1.5, tries=10)


@dataclass(frozen=True, slots=True)
class Measure:
    """One line of the result."""

    name: str
    value: float
    beside: float | None = None
    """Same figure for the bare server, or without the clients."""
    unit: str = ""
    target: str = ""
    holds: bool | None = None
    """True if the target is met; None without a target."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of the measures and the picture; times in s."""

    cell: Vector
    bare: Vector
    flat_out: Load
    busy: Vector
    """Time from sending a command to the first report in which the cell is not Idle, s."""
    busy_at_once: int
    """Number of commands with Busy set in the first answer."""
    idle_scans: Sequence[int]
    """Number of scans after each command that did not accept it."""
    quiet: Vector
    """Scan intervals minus the scan period without clients, s."""
    loaded: Vector
    """Scan intervals minus the scan period with clients, s."""
    polled: Load
    scan_period: float


def measure(loaded: LoadedConfig, effort: Effort) -> Samples:
    """Measure everything in one run.

    Args:
        loaded: A simulated cell in real time.
        effort: Extent of the measurement.

    Raises:
        CellError: A server does not answer.
    """
    period = 1.0 / loaded.cell.scan_rate
    scans: list[Scan] = []
    settings = patient(loaded.cell.plc, 2 * CLIENTS)
    with cell_process(loaded, scans, settings) as doors, bare_server() as bare_address:
        address = doors.plain
        with connected(address) as ours, connected(bare_address) as bare:
            times: tuple[list[float], list[float]] = ([], [])
            for _ in range(effort.rounds):
                for client, into in zip((ours, bare), times, strict=True):
                    into.extend(time_requests(client, effort.reads))
        flat_out = load(address, CLIENTS, effort.flat_out)
        with connected(address) as client:
            plc = Plc(client)
            plc.time_start(period)  # the first run of a process loads compiled code
            starts = [plc.time_start(period) for _ in range(effort.starts)]
            polled, quiet, busy = _stretches(address, plc, effort)
    return Samples(
        cell=np.array(times[0]),
        bare=np.array(times[1]),
        flat_out=flat_out,
        busy=np.array([start.seen - start.sent for start in starts]),
        busy_at_once=sum(start.is_at_once for start in starts),
        idle_scans=[_idle_scans(scans, start) for start in starts],
        quiet=_errors(scans, quiet, period),
        loaded=_errors(scans, busy, period),
        polled=polled,
        scan_period=period,
    )


_Stretch = tuple[float, float]


def _stretches(address: Address, plc: Plc, effort: Effort) -> tuple[Load, list[_Stretch], list[_Stretch]]:
    """Run insertions, alternately without and with polling clients; return the load and the times of the intervals."""
    is_over, quiet, busy, loads = threading.Event(), [], [], []
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(plc.keep_running, is_over)
        try:
            time.sleep(2.0 * effort.window)  # the first run begins
            for _ in range(effort.windows):
                started = time.perf_counter()
                time.sleep(effort.window)
                quiet.append((started, time.perf_counter()))
                started = time.perf_counter()
                loads.append(load(address, CLIENTS, round(effort.window / POLL_PERIOD), POLL_PERIOD))
                busy.append((started, time.perf_counter()))
        finally:
            is_over.set()
        running.result()
    sums = [sum(getattr(each, name) for each in loads) for name in ("sent", "answered", "duration")]
    return Load(CLIENTS, sums[0], sums[1], sums[2]), quiet, busy


def _idle_scans(scans: Sequence[Scan], start: Start) -> int:
    """Return the number of scans that began with the command in the cell and ended without it."""
    during = [(asked, state) for asked, state in scans if start.written < asked < start.seen]
    return len({asked for asked, _ in during} - {asked for asked, state in during if state != State.IDLE})


def _errors(scans: Sequence[Scan], stretches: Sequence[_Stretch], period: float) -> Vector:
    """Return the difference of each scan interval of the stretches from the period, s."""
    times = np.unique([asked for asked, _ in scans])
    return np.concatenate([np.diff(times[(times >= low) & (times <= high)]) - period for low, high in stretches])


def measures(samples: Samples) -> list[Measure]:
    """Return the measures from the samples."""
    cell, bare = float(np.median(samples.cell)), float(np.median(samples.bare))
    flat, polled, starts = samples.flat_out, samples.polled, len(samples.busy)
    quiet, busy = np.abs(samples.quiet), np.abs(samples.loaded)
    return [
        Measure("FC3 of 10 registers, p50", cell, bare, "s"),
        Measure("FC3 of 10 registers, p99", _p99(samples.cell), _p99(samples.bare), "s"),
        Measure("p50 over the bare server's", cell / bare, target=f"<= {RATIO}", holds=cell / bare <= RATIO),
        Measure(f"{CLIENTS} clients flat out, answers", flat.answered / flat.duration, unit="1/s"),
        Measure(f"{CLIENTS} clients flat out, lost", flat.lost, target="0", holds=flat.lost == 0),
        Measure(f"{CLIENTS} clients polling, lost", polled.lost, target="0", holds=polled.lost == 0),
        Measure(
            "commands without Busy in the first answer",
            starts - samples.busy_at_once,
            target="0",
            holds=starts == samples.busy_at_once,
        ),
        Measure(
            "scans that left a command waiting",
            sum(samples.idle_scans),
            target="0",
            holds=not any(samples.idle_scans),
        ),
        Measure("command to a cell at work, p50", float(np.median(samples.busy)), unit="s"),
        Measure("command to a cell at work, p99", _p99(samples.busy), unit="s"),
        Measure(f"scan jitter with {CLIENTS} clients, p99", _p99(busy), _p99(quiet), "s"),
        Measure(f"scan jitter with {CLIENTS} clients, largest", float(np.max(busy)), float(np.max(quiet)), "s"),
    ]


def _p99(values: Vector) -> float:
    return float(np.percentile(values, 99))


def write(lines: Sequence[Measure], folder: Path) -> list[Path]:
    """Write line.csv and line.json into `folder`, and return their paths."""
    paths = [folder / f"line.{kind}" for kind in ("csv", "json")]
    rows = [asdict(line) for line in lines]
    write_rows(rows, paths[0])
    paths[1].write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    return paths
