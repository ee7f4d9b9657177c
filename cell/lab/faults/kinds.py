"""Kinds of faults of the devices, and the table of all kinds."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from cell.lab.faults import devices
from cell.lab.faults.bench import FaultBench
from cell.lab.faults.computer_kinds import COMPUTER_KINDS
from cell.lab.faults.contract import FaultKind, Undo, changed
from cell.lab.faults.ends import PROGRAM_KINDS
from cell.lab.faults.plc_kinds import PLC_KINDS
from cell.lab.faults.skill_kinds import SKILL_KINDS
from drivers.quantities import SwitchState
from sim.boards.faulty import Change
from sim.config import WireFaults
from skills.catalogue import GRASP

PLAUSIBLE = "each of its readings is one that a sound device can give; only the effect shows the fault"
LOSSY = "enough frames arrive until several in a row are lost"
SLOW = {
    **dict.fromkeys(
        ("arm: place 1 mm off", "arm: place 5 mm low", "arm: place 20 mm off", "arm: place drifts"), PLAUSIBLE
    ),
    **dict.fromkeys(("arm: force of the other sign", "arm: wrench offset", "skin: drifting"), PLAUSIBLE),
    **{
        f"{wire}: a frame in {share}": LOSSY
        for wire in ("skin", "switch")
        for share in ("twenty lost", "fifty corrupt")
    },
    "switch: never": "before the peg is there the switch says what it should",
    "switch: frozen": "before the peg is there the switch says what it should",
    "hand: stuck": "a hand that shall not move shows nothing of it",
    "hand: weak": "a weak hand shows only once the peg slips",
}
"""Reasons why faults are not detected at once."""
SLACK = 1e-3
"""Opening of a hand that gives way, m."""
WEAK, STRONG = 2.0, 60.0
"""Closing forces of a hand that is weaker or stronger than commanded, N."""


def _wire(what: str, faults: WireFaults, bench: FaultBench) -> Undo:
    wire, now = getattr(bench, what), bench.cell.clock.now()
    moved = faults.model_copy(
        update={
            "unplugged": tuple((now + start, now + end) for start, end in faults.unplugged),
            "resets": tuple(now + instant for instant in faults.resets),
        }
    )
    return changed(wire, "faults", moved)


def _taxels(make: Callable[[], Change], bench: FaultBench) -> Undo:
    hub, change = bench.wire.board.hub, make()  # type: ignore[attr-defined]
    measure = hub.measure
    return changed(hub, "measure", lambda: change(measure()))


def _told(what: str, make: Callable[[], Change], bench: FaultBench) -> Undo:
    return changed(getattr(bench, what), "change", make())


def _lost(what: str, make: Callable[[], Callable[[str], bool]], bench: FaultBench) -> Undo:
    return changed(getattr(bench, what), "obeys", make())


def _early(lead: float, bench: FaultBench) -> Undo:
    """Close the switch at this distance before the peg is seated, m."""
    truth = bench.cell.truth
    assert truth is not None
    depth = bench.cell.config.hole.depth - lead
    return _told("switch", lambda: lambda state: SwitchState.CLOSED if truth().depth >= depth else state, bench)


def _grips(force: float, bench: FaultBench) -> Undo:
    """Change the closing force of a hand that grips, N."""
    hand = bench.gripper.device
    if hand.read().is_gripping:
        hand.grip(force)
    return lambda: hand.grip(bench.cell.config.params(GRASP).force) if hand.read().is_gripping else None


def _opened(bench: FaultBench) -> None:
    """Open a hand that grips by `SLACK`."""
    hand = bench.gripper.device
    if (state := hand.read()).is_gripping:
        hand.release(state.width + SLACK)


DEVICE_KINDS: tuple[FaultKind, ...] = (
    *(FaultKind(f"skin: {name}", partial(_wire, "wire", faults)) for name, faults in devices.WIRES.items()),
    *(FaultKind(f"skin: {name}", partial(_taxels, make)) for name, make in devices.SKIN.items()),
    *(FaultKind(f"switch: {name}", partial(_wire, "board", faults)) for name, faults in devices.WIRES.items()),
    *(FaultKind(f"switch: {name}", partial(_told, "switch", make)) for name, make in devices.SWITCH.items()),
    FaultKind("switch: 6 mm early", partial(_early, 0.006), slow=SLOW["switch: never"]),
    FaultKind("switch: 2 mm early", partial(_early, 0.002), slow=SLOW["switch: never"]),
    *(FaultKind(f"arm: {name}", partial(_told, "arm", make)) for name, make in devices.ARM.items()),
    *(FaultKind(f"hand: {name}", partial(_told, "gripper", make)) for name, make in devices.HAND.items()),
    *(FaultKind(name, partial(_lost, what, make)) for name, (what, make) in devices.LOST.items()),
    FaultKind("arm: halts by itself", lambda bench: bench.arm.device.halt()),
    FaultKind("hand: lets go", lambda bench: bench.gripper.device.release(0.06)),
    FaultKind("hand: opens by 1 mm", _opened),
    FaultKind("hand: weak", partial(_grips, WEAK)),
    FaultKind("hand: too strong", partial(_grips, STRONG)),
)
"""All kinds of faults of the devices."""

KINDS: tuple[FaultKind, ...] = (
    *(replace(kind, slow=SLOW.get(kind.name, kind.slow)) for kind in DEVICE_KINDS),
    *COMPUTER_KINDS,
    *PROGRAM_KINDS,
    *PLC_KINDS,
    *SKILL_KINDS,
)
"""All kinds in the campaign."""
