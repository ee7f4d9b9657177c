"""Measures of the wires: decoding rate and bus rate, age of frames, recovery of a lost board, and the same insertions."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.devices.assembly import bench_skin
from cell.lab.trials import TrialRow, run_trials
from cell.lab.wire import switch_wire
from cell.lab.wire.switch_wire import SwitchLine
from drivers.errors import SkinSilentError
from drivers.protocols import Clock, Skin
from drivers.skin.board_config import HubConfig, IcubConfig
from drivers.skin.boards import CanSkin, SerialSkin
from drivers.skin.port import HubOnCan, HubOnSerial, IcubOnCan, SkinPort
from drivers.transport.wires import CanFrame
from sim.board_clock import BoardClock
from sim.board_links import EmulatedCan, EmulatedLine, frame_bits
from sim.boards import IcubBoard
from sim.config import WireFaults
from sim.cyskin_board import CanBoard, EmulatedHub, SerialBoard
from skills.contract import Outcome

WIRES = {
    "can": ("skin.kind=can",),
    "can at 100 Hz": ("skin.kind=can", "skin.rate=100"),
    "serial": ("skin.kind=serial",),
    "serial at 100 Hz": ("skin.kind=serial", "skin.rate=100"),
    "icub": ("skin.kind=can", "skin.rate=25", 'skin.board={kind="icub"}'),
}
"""Wires to measure, and the keys of a cell with each."""
TRIED = {
    "sim": (),
    "can": ("skin.kind=can",),
    "serial": ("skin.kind=serial",),
    "icub": ("skin.kind=can", 'skin.board={kind="icub"}'),
    "switch": ("switch.kind=serial", "switch.port=emulated"),
}
"""Wires for whole insertions, and the keys of a cell with each; the others are compared with the first."""
BIT_RATE, BAUD_RATE = 1_000_000, 115_200
AWAY = 1.0
"""Time of a board without its plug, s."""


@dataclass(frozen=True, slots=True)
class DecodeLine:
    """Decoding rate of this machine for one board's data, beside the capacity of its wire."""

    wire: str
    unit: str
    """Counted item: CAN frames, or bytes."""
    decoded: float
    """Items decoded per second, on one core."""
    limit: float
    """Largest number of items per second on the wire."""
    scans: float
    """Whole scans decoded per second."""


@dataclass(frozen=True, slots=True)
class LatencyLine:
    """Age of a frame when the skill first reads it, and time to recover after the board was unplugged."""

    wire: str
    frames: int
    age_p50: float
    """Median time from measurement to the scan that reads it, s."""
    age_p99: float
    stamp_error: float
    """Largest difference between a frame's stamp and its measurement, s."""
    losses: int
    recovery_p50: float
    """Median time from plugging in to the first frame read, s."""
    recovery_max: float


@dataclass(frozen=True, slots=True)
class OutcomeLine:
    """Result of whole insertions on one wire."""

    kind: str
    trials: int
    successes: int
    same: int
    """Number of trials with the same ending as those of the plain simulated skin with the same seed."""
    mean_total: float
    """Mean total time of the successes, s."""
    longer: float
    """Mean difference of a success's time to the plain simulated skin's with the same seed, s; NaN for fewer than
    two."""
    longer_error: float
    """Standard error of that difference, s; it depends on a few long adjustments, and every wire draws different
    noise."""


def measure(
    config: CellConfig,
    seeds: Sequence[int],
    workers: int,
    folder: Path,
    quick: bool,
    done: Callable[[TrialRow], None],
) -> dict[str, Sequence[DecodeLine | LatencyLine | OutcomeLine | SwitchLine]]:
    """Return all measures; see `outcomes` for the arguments. `quick` takes fewer samples."""
    return {
        "decoding": decode_rates(500 if quick else 5000),
        "age and recovery": latencies(3 if quick else 40, 2.0 if quick else 10.0),
        "switch": [switch_wire.measure(20, 3) if quick else switch_wire.measure(400, 40)],
        "whole insertions": outcomes(config, seeds, workers, folder, done),
    }


def decode_rates(scans: int) -> list[DecodeLine]:
    """Return the rate at which `scans` scans are decoded on each wire."""
    rng = np.random.default_rng(0)

    def measure() -> Any:
        return rng.integers(3000, 20_000, (2, 20), dtype=np.uint16)

    hub, board = HubConfig(), IcubConfig(kind="icub")
    eight = BIT_RATE / frame_bits(8)
    lines = []
    can_link, serial_link, icub_link = _CanFeed(), _ByteFeed(), _CanFeed()
    wires: tuple[tuple[str, float, SkinPort, Any, Any], ...] = (
        ("can", eight, HubOnCan(can_link, hub, 0.01), CanBoard(EmulatedHub(hub, measure)), can_link),
        (
            "serial",
            BAUD_RATE / 10,
            HubOnSerial(serial_link, hub, 0.01),
            SerialBoard(EmulatedHub(hub, measure)),
            serial_link,
        ),
        ("icub", eight, IcubOnCan(icub_link, board), IcubBoard(board, measure), icub_link),
    )
    for name, limit, port, far, link in wires:
        _introduce(port, far, link)
        sent = [far.scan() for _ in range(scans)]
        started = time.perf_counter()
        whole = 0
        for number, items in enumerate(sent):
            link.put(items)
            whole += len(port.exchange(1.0 + 0.01 * number))
        spent = time.perf_counter() - started
        assert whole == scans
        unit = "bytes" if name == "serial" else "CAN frames"
        lines.append(DecodeLine(name, unit, sum(map(len, sent)) / spent, limit, scans / spent))
    return lines


def latencies(repeats: int, seconds: float) -> list[LatencyLine]:
    """Return age and recovery on each wire, each from `repeats` openings of `seconds`, s, at random phase."""
    lines = []
    for name, keys in WIRES.items():
        config = load(sets=keys).cell
        rng = np.random.default_rng(1)
        ages, errors, recoveries = [], [], []
        for _ in range(repeats):
            skin, clock, _ = bench_skin(config, 0.05)
            assert isinstance(clock, BoardClock)
            (link,) = clock.boards
            assert isinstance(link, EmulatedCan | EmulatedLine)
            assert isinstance(skin, CanSkin | SerialSkin)
            born = _watched(link, clock)
            clock.wait_until(float(rng.uniform(0.0, 1.0)))
            skin.open()
            clock.wait_until(clock.now() + float(rng.uniform(0.0, 1.0 / config.scan_rate)))
            for seen, stamp, measured in _first_sights(skin, clock, seconds, 1.0 / config.scan_rate, born):
                ages.append(seen - measured)
                errors.append(abs(stamp - measured))
            recoveries.append(_recovery(skin, clock, link, 1.0 / config.scan_rate, rng))
            skin.close()
        lines.append(
            LatencyLine(
                name,
                len(ages),
                float(np.percentile(ages, 50)),
                float(np.percentile(ages, 99)),
                max(errors),
                len(recoveries),
                float(np.percentile(recoveries, 50)),
                max(recoveries),
            )
        )
    return lines


def outcomes(
    config: CellConfig, seeds: Sequence[int], workers: int, folder: Path, done: Callable[[TrialRow], None]
) -> list[OutcomeLine]:
    """Run the same seeds with the plain skin and through each wire; each has a folder for its rows.

    Args:
        config: Config of a simulated cell; its skin's rate and layout are kept.
        seeds: Seeds, one trial each.
        workers: Number of processes.
        folder: Folder of the tables.
        done: Called after every trial.
    """
    plain: list[TrialRow] = []
    lines = []
    for kind, keys in TRIED.items():
        cell = load(sets=[*keys, f"skin.rate={config.skin.rate}", f"skin.layout={config.skin.layout}"]).cell
        wired = config.model_copy(update={"skin": cell.skin, "switch": cell.switch})
        rows = run_trials(wired, seeds, workers, folder / kind, done)
        plain = plain or rows
        lines.append(compared(kind, rows, plain))
    return lines


def compared(kind: str, rows: Sequence[TrialRow], plain: Sequence[TrialRow]) -> OutcomeLine:
    """Return the comparison of insertions on one wire with those of the plain simulated skin, both sorted by seed."""
    totals = [row.total_time for row in rows if row.outcome == Outcome.SUCCESS and row.total_time is not None]
    longer = [
        row.total_time - other.total_time
        for row, other in zip(rows, plain, strict=True)
        if row.outcome == other.outcome == Outcome.SUCCESS
        and row.total_time is not None
        and other.total_time is not None
    ]
    return OutcomeLine(
        kind,
        len(rows),
        len(totals),
        sum(row.outcome == other.outcome for row, other in zip(rows, plain, strict=True)),
        float(np.mean(totals)) if totals else math.nan,
        float(np.mean(longer)) if len(longer) > 1 else math.nan,
        float(np.std(longer, ddof=1) / math.sqrt(len(longer))) if len(longer) > 1 else math.nan,
    )


class _CanFeed:
    """A bus that delivers the frames put into it."""

    def __init__(self) -> None:
        self.waiting: deque[CanFrame] = deque()
        self.sent: list[CanFrame] = []

    def open(self) -> None: ...

    def close(self) -> None: ...

    def put(self, items: Sequence[CanFrame]) -> None:
        self.waiting.extend(items)

    def read(self, timeout: float) -> CanFrame | None:
        return self.waiting.popleft() if self.waiting else None

    def write(self, frame: CanFrame) -> None:
        self.sent.append(frame)


class _ByteFeed:
    """A line that delivers the bytes put into it."""

    character_time = 0.0

    def __init__(self) -> None:
        self.waiting = bytearray()
        self.sent: list[int] = []

    def open(self) -> None: ...

    def close(self) -> None: ...

    def put(self, items: Sequence[int]) -> None:
        self.waiting += bytes(items)

    def read(self, timeout: float) -> bytes:
        data = bytes(self.waiting)
        self.waiting.clear()
        return data

    def write(self, data: bytes) -> None:
        self.sent += data


def _introduce(port: SkinPort, far: Any, link: Any) -> None:
    """Let host and board communicate until the board has started."""
    now = -100.0
    while math.isinf(far.next_scan):
        now += 1.0
        port.exchange(now)
        for item in link.sent:
            link.put(far.take(item, 0.0))
        link.sent.clear()


def _watched(link: EmulatedCan | EmulatedLine, clock: Clock) -> list[float]:
    """Return a list to which the time of every board measurement is appended."""
    born: list[float] = []
    board: Any = getattr(link.board, "hub", link.board)
    measure = board.measure

    def watched() -> Any:
        born.append(clock.now())
        return measure()

    board.measure = watched
    return born


def _first_sights(
    skin: CanSkin | SerialSkin, clock: Clock, seconds: float, period: float, born: list[float]
) -> Iterator[tuple[float, float, float]]:
    """Yield for every new frame the time of the first scan that reads it, its stamp, and its measurement time, s."""
    end, shown = clock.now() + seconds, skin.read().sequence
    while clock.now() < end:
        clock.wait_until(clock.now() + period)
        frame = skin.read()
        if frame.sequence != shown:
            shown = frame.sequence
            yield clock.now(), frame.stamp, born[skin.figures().scans - 1]


def _recovery(
    skin: Skin, clock: Clock, link: EmulatedCan | EmulatedLine, period: float, rng: np.random.Generator
) -> float:
    """Unplug the board for a while; return the time from plugging it in to the first new frame, s."""
    start = clock.now() + float(rng.uniform(0.0, 0.2))
    plugged = start + AWAY
    link.faults = WireFaults(unplugged=((start, plugged),))
    while True:
        clock.wait_until(clock.now() + period)
        try:
            frame = skin.read()
        except SkinSilentError:
            continue
        if frame.stamp > plugged:
            return clock.now() - plugged
