"""Speed of the program in figures with little influence of other programs on the computer.

A count is the same on every computer. A ratio is a time divided by that of a reference, both measured alternately in
the same minute. The smallest of several times is used, because other programs can only slow a run.
"""

import cProfile
import math
import socket
import statistics
import subprocess
import sys
import time
import tomllib
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from cell.config.cell_config import CellConfig
from cell.config.load import LoadedConfig
from cell.devices.assembly import assemble, opened
from cell.lab.trials import Probe, run_trial, seeded, trial_in
from drivers.quantities import ImpedanceSetpoint
from skills.contract import Observation
from tests.bench.speed.reference import bare_second
from tests.bench.speed.starts import processor_time, start_of

SEED = 1
"""Seed of the measured trial."""
PAIRS = 3
"""Number of alternate measurements of a figure and its reference."""
REQUESTS = 2000
READ_TEN, ANSWERED = b"\x00\x01\x00\x00\x00\x06\x01\x03\x00\x00\x00\x0a", 29
"""FC3 of 10 registers in its frame, and the size of the answer, bytes."""
SMALL = 0.01
"""Share of a scan below which parts are combined."""
IMPORT_MUJOCO = ("-c", "import mujoco")
OPEN_CELL = (
    "-c",
    "from cell.devices.assembly import assemble, opened\nfrom cell.config.load import load\nwith opened(assemble(load().cell)): pass",
)


@dataclass(frozen=True, slots=True)
class Stored:
    """A figure at the time of its storage."""

    value: float
    what: str


def stored() -> tuple[dict[str, Stored], dict[str, Stored]]:
    """Return the stored counts and ratios by name."""
    text = Path(__file__).with_name("figures.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    counts, ratios = ({name: Stored(**entry) for name, entry in tables[kind].items()} for kind in ("counts", "ratios"))
    return counts, ratios


@dataclass(frozen=True, slots=True)
class Each(Probe):
    """Calls a function in every scan."""

    note: Callable[[], None]

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Call the function."""
        self.note()


def counts_of_a_scan(config: CellConfig) -> dict[str, float]:
    """Return calls and temporary memory per scan of a trial with compiled functions."""
    scans = round(run_trial(config, SEED).sim_time * config.scan_rate)
    watch = cProfile.Profile()
    with opened(assemble(seeded(config, SEED))) as cell:
        watch.enable()
        trial_in(cell, SEED)
        watch.disable()
    peaks: list[int] = []

    def note() -> None:
        now, peak = tracemalloc.get_traced_memory()
        peaks.append(peak - now)
        tracemalloc.reset_peak()

    with opened(assemble(seeded(config, SEED))) as cell:
        tracemalloc.start()
        trial_in(cell, SEED, lambda cell, ctx: Each(note))
        tracemalloc.stop()
    calls = sum(entry.callcount for entry in watch.getstats())
    return {"calls": calls / scans, "memory": statistics.fmean(peaks)}


def counts_of_starts() -> dict[str, float]:
    """Return modules and compilations of commands: of a first demo without compiled code, and of later ones."""
    found: dict[str, float] = {}
    with TemporaryDirectory() as folder:
        environment = {"XDG_CACHE_HOME": folder}
        journal = ("--journal", f"{folder}/runs")
        port = ("--set", "plc.modbus.port=0")
        commands = {
            "demo": ("demo", "--trials", "1", "--out", f"{folder}/out", *journal, *port),
            "serve": ("serve", *journal, *port),
        }
        for name, arguments in commands.items():
            found[f"{name}_compiled"] = start_of(arguments, environment, counts=True).compiled
            found[f"{name}_modules"] = len(start_of(arguments, environment).modules)
        found["map_modules"] = len(start_of(("map",), environment).modules)
    return found


def ratio(ours: Callable[[], float], reference: Callable[[], float], pairs: int = PAIRS) -> float:
    """Return our smallest time divided by the reference's smallest time, measured alternately."""
    mine, its = zip(*[(ours(), reference()) for _ in range(pairs)], strict=True)
    return float(min(mine) / min(its))


def trial_ratio(config: CellConfig) -> float:
    """Return the time of a simulated second of a trial divided by that of the same bare steps of the stored models."""
    run_trial(config, SEED)
    return ratio(lambda: trial_time(config).whole, bare_second)


def scan_ratio(config: CellConfig) -> float:
    """Return the time of a scan outside `mj_step` divided by that of a fixed piece of Python."""
    run_trial(config, SEED)
    return ratio(lambda: trial_time(config).outside, plain_python)


def request_ratio() -> float:
    """Return the median time of a read of ten registers from a served cell divided by that from pymodbus's own server."""
    with TemporaryDirectory() as folder:
        cell = ("cell", "serve", "--journal", folder, "--set", "plc.modbus.port=0")
        with _serving(*cell) as ours, _serving("tests.bench.speed.bare") as bare:
            return ratio(lambda: read_time(ours), lambda: read_time(bare))


@contextmanager
def _serving(*arguments: str) -> Iterator[tuple[str, int]]:
    """Yield the address of a server in a separate process; its first line ends with its port."""
    with subprocess.Popen(
        [sys.executable, "-m", *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            yield "127.0.0.1", int(process.stdout.readline().rpartition(":")[2])
        finally:
            process.terminate()


def read_time(address: tuple[str, int]) -> float:
    """Return the median time of a read of ten registers over Modbus TCP, s."""
    times = []
    with socket.create_connection(address, timeout=10.0) as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        answers = client.makefile("rb")
        for _ in range(REQUESTS):
            started = time.perf_counter()
            client.sendall(READ_TEN)
            answers.read(ANSWERED)
            times.append(time.perf_counter() - started)
    return statistics.median(times)


def start_ratio() -> float:
    """Return the processor time of opening a cell with compiled code, divided by that of `import mujoco`."""
    processor_time(OPEN_CELL)
    return ratio(lambda: processor_time(OPEN_CELL), lambda: processor_time(IMPORT_MUJOCO))


@dataclass(frozen=True, slots=True)
class TrialTime:
    """Processor time of one trial."""

    simulated: float
    """Simulated time, s."""
    scans: int
    total: float
    """Time of the trial, s."""
    stepping: float
    """Time of the trial in `mj_step`, s."""

    @property
    def whole(self) -> float:
        """Time of a simulated second, s."""
        return self.total / self.simulated

    @property
    def outside(self) -> float:
        """Time of a scan outside `mj_step`, s."""
        return (self.total - self.stepping) / self.scans


def trial_time(config: CellConfig, watch: cProfile.Profile | None = None) -> TrialTime:
    """Run one trial and return its times; `watch` profiles it."""
    from sim.world import native
    from sim.world.physics import World

    with opened(assemble(seeded(config, SEED))) as cell:
        world = getattr(cell.truth, "__self__", None)
        assert isinstance(world, World)
        stepped = last = 0.0

        def note() -> None:
            nonlocal stepped, last
            passed = native.step_time(world.physics()[1])
            # The time starts again when another model takes over.
            stepped, last = stepped + passed - (last if passed >= last else 0.0), passed

        with native.clocked(), watch or nullcontext():
            began, clock, started = world.now(), time.perf_counter(), time.thread_time()
            trial_in(cell, SEED, lambda cell, ctx: Each(note))
            total, wall, simulated = time.thread_time() - started, time.perf_counter() - clock, world.now() - began
    # MuJoCo measures its steps by the wall clock; other programs lengthen both times equally.
    return TrialTime(simulated, round(simulated * config.scan_rate), total, stepped / wall * total)


def plain_python() -> float:
    """Return the processor time of a fixed piece of Python without arrays, s: calls, attributes, sums and a dictionary."""
    started = time.thread_time()
    kept: dict[int, float] = {}
    for number in range(1000):
        kept[number % 64] = math.hypot(number, kept.get(number % 64, 1.0)) / max(number, 1)
    return time.thread_time() - started


def profile(config: CellConfig) -> tuple[TrialTime, dict[str, float]]:
    """Return the times of a trial, and the time of a scan by package, s.

    Python's profiler slows the program. It therefore only distributes the time outside `mj_step`, which is measured
    without it. Time in a built-in function or a library belongs to the package that called it.
    """
    run_trial(config, SEED)
    plain = min((trial_time(config) for _ in range(PAIRS)), key=lambda taken: taken.total)
    watch = cProfile.Profile(time.thread_time)
    watched = trial_time(config, watch)
    own: dict[str, float] = {}
    for entry in watch.getstats():
        package = _package(entry.code)
        own[package] = own.get(package, 0.0) + entry.inlinetime
        for called in entry.calls or ():
            if package != OTHERS and _package(called.code) == OTHERS:
                own[package] = own.get(package, 0.0) + called.inlinetime
                own[OTHERS] = own.get(OTHERS, 0.0) - called.inlinetime
    own[ENGINE] -= watched.stepping
    scale = plain.outside / sum(own.values())
    parts = {"mj_step": plain.stepping / plain.scans} | {name: spent * scale for name, spent in own.items()}
    large = {name: spent for name, spent in parts.items() if spent >= SMALL * plain.total / plain.scans}
    large["the rest"] = sum(parts.values()) - sum(large.values())
    return plain, dict(sorted(large.items(), key=lambda part: -part[1]))


ENGINE, OTHERS = "sim/world", "libraries"


def _package(code: object) -> str:
    """Return the first two names of the path of a function in this project."""
    path, root = Path(getattr(code, "co_filename", "")), Path(__file__).parents[3]
    if not path.is_relative_to(root) or any(part in path.parts for part in ("site-packages", ".venv")):
        return OTHERS
    return "/".join(path.relative_to(root).with_suffix("").parts[:2])


def all_ratios(loaded: LoadedConfig) -> Mapping[str, Callable[[], float]]:
    """Return the measure of each ratio by its name."""
    return {
        "trial": lambda: trial_ratio(loaded.cell),
        "scan": lambda: scan_ratio(loaded.cell),
        "request": request_ratio,
        "start": start_ratio,
    }
