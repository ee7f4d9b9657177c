"""Kinds of faults: how each begins and how an operator ends it."""

import resource
import sqlite3
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

from cell.journal import INDEX
from cell.lab.faults import devices
from cell.lab.faults.bench import FaultBench
from drivers.quantities import SwitchState
from drivers.skin.health import Counts
from sim.config import WireFaults

AWAY = ((0.0, 1e6),)
HELD_UP = 0.5
"""Time for which something holds up the scan or locks the index, s of wall time."""
Undo = Callable[[], None]


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind of fault."""

    name: str
    begin: Callable[[FaultBench], Undo]
    """Function that does the harm, on the scan thread, and returns what mends it."""
    is_harmless: bool = False
    """Whether the cell has to go on as if nothing had happened."""
    ends_program: bool = False
    """Whether the program ends and is started again."""


def _wire(faults: WireFaults) -> Callable[[FaultBench], Undo]:
    def begin(bench: FaultBench) -> Undo:
        bench.wire.faults = faults
        return lambda: setattr(bench.wire, "faults", WireFaults())

    return begin


def _board(faults: WireFaults) -> Callable[[FaultBench], Undo]:
    def begin(bench: FaultBench) -> Undo:
        bench.board.faults = faults
        return lambda: setattr(bench.board, "faults", WireFaults())

    return begin


def _taxels(make: Callable[[], devices.Change[Counts]]) -> Callable[[FaultBench], Undo]:
    def begin(bench: FaultBench) -> Undo:
        hub, change = bench.wire.board.hub, make()  # type: ignore[attr-defined]
        measure = hub.measure
        hub.measure = lambda: change(measure())
        return lambda: setattr(hub, "measure", measure)

    return begin


def _told(what: str, change: Callable[..., object]) -> Callable[[FaultBench], Undo]:
    def begin(bench: FaultBench) -> Undo:
        device = getattr(bench, what)
        before, device.change = device.change, change
        return lambda: setattr(device, "change", before)

    return begin


def _obeys_not(what: str, how: str) -> Callable[[FaultBench], Undo]:
    def begin(bench: FaultBench) -> Undo:
        device = getattr(bench, what)
        setattr(device, how, True)
        return lambda: setattr(device, how, False)

    return begin


def _late_states(bench: FaultBench) -> Undo:
    first = bench.arm.arm.read()
    bench.arm.change = lambda state: first
    return lambda: setattr(bench.arm, "change", lambda state: state)


def _lets_go(bench: FaultBench) -> Undo:
    bench.gripper.gripper.release(0.06)
    return lambda: None


def _early(bench: FaultBench) -> Undo:
    truth = bench.cell.truth
    assert truth is not None
    depth = bench.cell.config.hole.depth - 0.006
    bench.switch.change = lambda state: SwitchState.CLOSED if truth().depth >= depth else state
    return lambda: setattr(bench.switch, "change", lambda state: state)


def _full(bench: FaultBench) -> Undo:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _locked(bench: FaultBench) -> Undo:
    done = threading.Event()

    def hold() -> None:
        with closing(sqlite3.connect(bench.journal.folder / INDEX, isolation_level=None, timeout=10.0)) as index:
            index.execute("BEGIN IMMEDIATE")
            done.wait()
            index.execute("ROLLBACK")

    thread = threading.Thread(target=hold)
    thread.start()

    def undo() -> None:
        done.set()
        thread.join()

    return undo


def _deleted(bench: FaultBench) -> Undo:
    for file in bench.journal.folder.glob(f"{INDEX}*"):
        file.unlink(missing_ok=True)
    return lambda: None


def _torn(bench: FaultBench) -> Undo:
    index = bench.journal.folder / INDEX
    index.write_bytes(b"\xff" * index.stat().st_size)
    return lambda: None


def _held_up(bench: FaultBench) -> Undo:
    time.sleep(HELD_UP)
    return lambda: None


def _raises(bench: FaultBench) -> Undo:
    raise ValueError("a skill that nobody tested")


def _stop_asked(bench: FaultBench) -> Undo:
    bench.stop.set()
    return lambda: None


KINDS: tuple[FaultKind, ...] = (
    FaultKind("skin: unplugged", _wire(WireFaults(unplugged=AWAY))),
    FaultKind("skin: frames lost", _wire(WireFaults(drop=0.5))),
    FaultKind("skin: frames corrupt", _wire(WireFaults(corrupt=0.5))),
    FaultKind("skin: frames late", _wire(WireFaults(delay=0.5))),
    FaultKind("skin: frozen", _taxels(devices.frozen)),
    FaultKind("skin: zero", _taxels(lambda: devices.filled(0))),
    FaultKind("skin: saturated", _taxels(lambda: devices.filled(42_990))),
    FaultKind("skin: stuck below the rail", _taxels(lambda: devices.filled(42_000))),
    FaultKind("skin: offset", _taxels(lambda: devices.shifted)),
    FaultKind("skin: modules swapped", _taxels(lambda: devices.modules_swapped)),
    FaultKind("skin: random", _taxels(devices.at_random)),
    FaultKind("switch: unplugged", _board(WireFaults(unplugged=AWAY))),
    FaultKind("switch: wire broken", _board(WireFaults(corrupt=0.5))),
    FaultKind("switch: never", _told("switch", lambda state: SwitchState.OPEN)),
    FaultKind("switch: always", _told("switch", lambda state: SwitchState.CLOSED)),
    FaultKind("switch: early", _early),
    FaultKind("switch: flapping", _told("switch", devices.flapping())),
    FaultKind("arm: reflex", _told("arm", devices.reflex)),
    FaultKind("arm: stopped", _told("arm", devices.stopped)),
    FaultKind("arm: silent", _told("arm", devices.silent_arm)),
    FaultKind("arm: states late", _late_states),
    FaultKind("arm: wrench no number", _told("arm", devices.no_number)),
    FaultKind("arm: wrench offset", _told("arm", devices.offset_wrench)),
    FaultKind("arm: deaf", _obeys_not("arm", "is_deaf")),
    FaultKind("hand: silent", _told("gripper", devices.silent_hand)),
    FaultKind("hand: stuck", _obeys_not("gripper", "is_stuck")),
    FaultKind("hand: lets go", _lets_go),
    FaultKind("disk: full", _full, is_harmless=True),
    FaultKind("disk: index locked", _locked, is_harmless=True),
    FaultKind("disk: index deleted", _deleted, is_harmless=True),
    FaultKind("disk: index torn", _torn, is_harmless=True),
    FaultKind("process: starved", _held_up, is_harmless=True),
    FaultKind("skill: raises", _raises),
    FaultKind("program: asked to end", _stop_asked, ends_program=True),
)
"""All kinds that are tried."""
