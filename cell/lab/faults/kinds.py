"""Kinds of faults of devices, PLCs and skills, and the table of all kinds."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from types import ModuleType

import numpy as np

from cell.lab.faults import devices
from cell.lab.faults.bench import LIFE_TIMEOUT, FaultBench
from cell.lab.faults.cases import INSERT
from cell.lab.faults.computer_kinds import COMPUTER_KINDS
from cell.lab.faults.contract import FaultKind, Undo, changed
from cell.lab.faults.ends import PROGRAM_KINDS
from drivers.errors import CellError
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, SwitchState, Vector
from plc_bridge.peer import CellSilentError, Peer
from plc_bridge.protocol.messages import Control
from sim.boards.faulty import Change
from sim.config import WireFaults
from skills.catalogue import GRASP
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.insert import spiral_adjust, tactile_insert
from skills.insert.spiral_adjust import SpiralAdjustResult
from skills.insert.tactile_insert import TactileInsertResult
from skills.search import spray_search
from skills.search.spray_search import SpraySearchResult

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
    "switch: never": "until the peg is seated, the switch reads the same as a good one",
    "switch: frozen": "until the peg is seated, the switch reads the same as a good one",
    "hand: stuck": "the fault has no effect until the hand must move",
    "hand: weak": "a weak hand shows only once the peg slips",
}
"""Reasons why faults are not detected at once."""
SLACK = 1e-3
"""Distance by which a gripping hand opens, m."""
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
    """Close the switch at the distance `lead`, m, before the peg is seated."""
    depth = bench.cell.config.hole.depth - lead
    return _told("switch", lambda: lambda state: SwitchState.CLOSED if bench.truth.depth >= depth else state, bench)


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

LASTING = 0.5
"""Duration of torn blocks and foreign connections, s of wall time."""
SILENT = "a silent PLC counts as lost only after plc.life_timeout"


def _silent(act: Callable[[FaultBench], None], bench: FaultBench) -> None:
    bench.plc_act = lambda: act(bench)
    # The silence is in wall time, and simulated time runs faster: the simulation stops until the timeout.
    time.sleep(LIFE_TIMEOUT)


def _killed(bench: FaultBench) -> None:
    bench.is_plc_lost = True
    bench.peer.close()
    raise CellSilentError("the PLC was switched off")


def _frozen(bench: FaultBench) -> None:
    bench.is_plc_lost = True
    raise CellSilentError("the PLC's program stands still")  # the PLC's connection stays open until it reconnects


def _torn(bench: FaultBench) -> Undo:
    return changed(bench.peer, "torn_until", time.monotonic() + LASTING)


def _second(bench: FaultBench) -> Undo:
    thread = threading.Thread(target=_command, args=(bench,), daemon=True)
    thread.start()
    return thread.join


def _command(bench: FaultBench) -> None:
    """Let another PLC request the lease, and every command that only the holder may request."""
    peer, until = Peer(*bench.bridge.address), time.monotonic() + LASTING
    with suppress(CellError):
        peer.connect()
        peer.take()
        while time.monotonic() < until:
            for code in (INSERT, Control.HOLD, Control.RESET, Control.CLEARED):
                peer.trigger(code)
    peer.close()


PLC_KINDS: tuple[FaultKind, ...] = (
    FaultKind("plc: killed", partial(_silent, _killed), silences_plc=True, slow=SILENT),
    FaultKind("plc: frozen", partial(_silent, _frozen), silences_plc=True, slow=SILENT),
    FaultKind("plc: blocks torn", _torn, is_harmless=True),
    FaultKind("plc: two at once", _second, is_harmless=True),
)
"""All kinds of PLC faults."""

BLOCKED = 0.5
"""Time without a scan in a skill, s."""
FAR, DEEP, DRIFT = 0.5, 0.09, 0.002
"""Errors of a setpoint, m: a sideways step, a downward step, and the downward increment of each scan."""
DONE = (Outcome.SUCCESS, Reason.NONE, 0.0)
Wrong = Callable[[ImpedanceSetpoint], ImpedanceSetpoint]


def _raises(bench: FaultBench) -> None:
    raise ValueError("an error in a skill")


def _blocks(bench: FaultBench) -> None:
    bench.cell.clock.wait_until(bench.cell.clock.now() + BLOCKED)


def _asks(make: Callable[[], Wrong], bench: FaultBench) -> Undo:
    wrong, follow = make(), SkillContext.follow
    return changed(SkillContext, "follow", lambda ctx, setpoint: follow(ctx, wrong(setpoint)))


def _shifted(way: Vector) -> Wrong:
    return lambda setpoint: replace(setpoint, tip=setpoint.tip + way)


def _drifting() -> Wrong:
    scans: list[int] = []

    def wrong(setpoint: ImpedanceSetpoint) -> ImpedanceSetpoint:
        scans.append(0)
        return replace(setpoint, tip=setpoint.tip - DRIFT * len(scans) * UP)

    return wrong


def _lies(bench: FaultBench) -> Undo:
    """Make search, insertion and adjustment report success without doing anything."""
    said: tuple[tuple[ModuleType, SkillResult], ...] = (
        (spray_search, SpraySearchResult(*DONE, (0.5, 0.0, 0.1), (0.5, 0.0), 0, None)),
        (tactile_insert, TactileInsertResult(*DONE, 0.0, 0.0)),
        (spiral_adjust, SpiralAdjustResult(*DONE, 0.0, 0.02)),
    )
    undo = [changed(module, "run", lambda *given, result=result, **named: result) for module, result in said]
    return lambda: [each() for each in undo]


SKILL_KINDS: tuple[FaultKind, ...] = (
    FaultKind("skill: raises", _raises),
    FaultKind("skill: blocks", _blocks),
    FaultKind("skill: asks for no number", partial(_asks, lambda: _shifted(np.full(3, np.nan)))),
    FaultKind("skill: asks for far away", partial(_asks, lambda: _shifted(np.array([FAR, 0.0, 0.0])))),
    FaultKind("skill: presses", partial(_asks, lambda: _shifted(-DEEP * UP))),
    FaultKind("skill: drifts downward", partial(_asks, _drifting)),
    FaultKind("skill: lies", _lies, slow="the cell judges a reported success when the run ends"),
)
"""All kinds of skill faults."""

KINDS: tuple[FaultKind, ...] = (
    *(replace(kind, slow=SLOW.get(kind.name, kind.slow)) for kind in DEVICE_KINDS),
    *COMPUTER_KINDS,
    *PROGRAM_KINDS,
    *PLC_KINDS,
    *SKILL_KINDS,
)
"""All kinds in the campaign."""
