"""Kinds of faults of the devices, and the table of all kinds."""

from collections.abc import Callable

from cell.lab.faults import devices
from cell.lab.faults.bench import FaultBench
from cell.lab.faults.computer_kinds import COMPUTER_KINDS
from cell.lab.faults.contract import FaultKind, Undo
from cell.lab.faults.ends import PROCESS_KINDS
from cell.lab.faults.plc_kinds import PLC_KINDS
from cell.lab.faults.skill_kinds import SKILL_KINDS
from drivers.quantities import SwitchState
from drivers.skin.health import Counts
from sim.config import WireFaults
from skills.catalogue import GRASP

AWAY = ((0.0, 1e6),)
THERE = "before the peg is there the switch says what it should"
"""Reason why a switch fault is not detected at once."""
WEAK = 2.0
"""Closing force of a weakened hand, N."""


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


def _readings_still(bench: FaultBench) -> Undo:
    bench.arm.change = devices.still()
    return lambda: setattr(bench.arm, "change", lambda state: state)


def _lets_go(bench: FaultBench) -> Undo:
    bench.gripper.gripper.release(0.06)
    return lambda: None


def _early(lead: float) -> Callable[[FaultBench], Undo]:
    """Return a fault in which the switch closes at this distance before the peg is seated, m."""

    def begin(bench: FaultBench) -> Undo:
        truth = bench.cell.truth
        assert truth is not None
        depth = bench.cell.config.hole.depth - lead
        bench.switch.change = lambda state: SwitchState.CLOSED if truth().depth >= depth else state
        return lambda: setattr(bench.switch, "change", lambda state: state)

    return begin


def _weak(bench: FaultBench) -> Undo:
    hand = bench.gripper.gripper
    if hand.read().is_gripping:
        hand.grip(WEAK)
    return lambda: hand.grip(bench.cell.config.params(GRASP).force) if hand.read().is_gripping else None


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
    FaultKind("skin: fingers swapped", _taxels(lambda: devices.fingers_swapped)),
    FaultKind("skin: random", _taxels(devices.at_random)),
    FaultKind("switch: unplugged", _board(WireFaults(unplugged=AWAY))),
    FaultKind("switch: wire broken", _board(WireFaults(corrupt=0.5))),
    FaultKind("switch: never", _told("switch", lambda state: SwitchState.OPEN), slow=THERE),
    FaultKind("switch: always", _told("switch", lambda state: SwitchState.CLOSED)),
    FaultKind("switch: 6 mm early", _early(0.006), slow=THERE),
    FaultKind("switch: 2 mm early", _early(0.002), slow=THERE),
    FaultKind("switch: flapping", _told("switch", devices.flapping())),
    FaultKind("arm: reflex", _told("arm", devices.reflex)),
    FaultKind("arm: stopped", _told("arm", devices.stopped)),
    FaultKind("arm: silent", _told("arm", devices.silent_arm)),
    FaultKind("arm: states late", _late_states),
    FaultKind("arm: wrench no number", _told("arm", devices.no_number)),
    FaultKind("arm: joint no number", _told("arm", devices.no_joint)),
    FaultKind("arm: stamp no number", _told("arm", devices.no_stamp)),
    FaultKind("arm: force beyond any sensor", _told("arm", devices.beyond_any_sensor)),
    FaultKind("arm: readings still", _readings_still),
    FaultKind("arm: wrench offset", _told("arm", devices.offset_wrench)),
    FaultKind("arm: deaf", _obeys_not("arm", "is_deaf")),
    FaultKind("hand: silent", _told("gripper", devices.silent_hand)),
    FaultKind("hand: stuck", _obeys_not("gripper", "is_stuck"), slow="a hand that shall not move shows nothing of it"),
    FaultKind("hand: lets go", _lets_go),
    FaultKind("hand: weak", _weak, slow="a weak hand shows only once the peg slips"),
    *COMPUTER_KINDS,
    *PROCESS_KINDS,
    *PLC_KINDS,
    *SKILL_KINDS,
)
"""All kinds in the campaign."""
