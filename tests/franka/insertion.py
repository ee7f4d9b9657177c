"""Whole insertions with every device behind its wire: `python -m tests.franka.insertion [--seed 2] [--seeds 1]`.

Skin hub on a CAN bus of python-can, switch firmware on an emulated chip behind a serial port, arm and hand through
their maker's client library and protocol. Prints one line of JSON a seed: how it ended by the cell, in truth, and with
the plain stand-ins, and how the torque loop kept its time; and one that counts them where there are several.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.devices.assembly import Cell
from cell.devices.assembly import opened as cell_opened
from cell.lab.trials import run_trial
from cell.peg.ending import ending_of
from drivers.arm.franka import FrankaArm
from drivers.errors import CellError
from drivers.gripper.franka import FrankaGripper
from drivers.gripper.franka_config import FrankaGripperConfig
from sim.world.line import EXCHANGE_STEPS, EXCHANGE_TIME
from skills.catalogue import CATALOGUE
from skills.contract import Outcome
from skills.flow import StageRecord
from tests.franka import apart
from tests.franka.simulated import arm_at
from tests.wired import Wires

CLEARING = 0.5
"""Time that a person takes with a peg, s: the fingers have met, and the hand reports it, before it is reported as removed."""
ACT_STEP = EXCHANGE_TIME / EXCHANGE_STEPS
"""Time between two looks of the boards meanwhile, s."""


@dataclass
class WiredCell:
    """An opened cell, and what is behind its wires."""

    cell: Cell
    wires: Wires
    arm: FrankaArm
    gripper: FrankaGripper
    bench: Any
    """A `tests.franka.apart.Bench`."""


@contextmanager
def opened(config: CellConfig, host: str) -> Iterator[WiredCell]:
    """Yield a cell with arm and hand on `host`, an address of the loopback, and skin and switch on emulated boards."""
    with apart.bench(config, host) as bench:
        wires = Wires(config, bench, bench.skin_noise())
        model = config.arm_model()
        arm = arm_at(host, model, wires.clock)
        gripper = FrankaGripper(FrankaGripperConfig(kind="franka", host=host), model.hand.stroke)

        def act(name: str, seconds: float) -> Callable[[], None]:
            """Return an act of a person at the cell, which takes time in which the boards go on."""

            def done() -> None:
                bench.act(name)
                for _ in range(round(seconds / ACT_STEP)):
                    wires.clock.wait_until(wires.clock.now() + ACT_STEP)

            return done

        cell = Cell(
            config,
            wires.clock,
            arm,
            gripper,
            wires.skin,
            wires.switch,
            bench.stock,
            exchange=act("exchange", EXCHANGE_TIME),
            refill=act("refill", 0.0),
            clear=act("clear", EXCHANGE_TIME + CLEARING),
            boards=(wires,),
        )
        with cell_opened(cell):
            try:
                yield WiredCell(cell, wires, arm, gripper, bench)
            finally:
                bench.let_go()


def inserted(host: str, seed: int, sets: Sequence[str] = ()) -> dict[str, Any]:
    """Run `insert_peg` with arm and hand on `host`, an address of the loopback; return what `main` prints."""
    config = load(sets=["sim.pace=max", "reality.scale=0.0", f"sim.seed={seed}", *sets]).cell
    with opened(config, host) as wired:
        began = time.monotonic()
        fault: CellError | None = None
        records: list[StageRecord] = []
        try:
            records = CATALOGUE["insert_peg"].run(config.skill_set(), wired.cell.context(seed))
        except CellError as error:
            fault = error
        figures, truth = asdict(wired.arm.figures()), wired.bench.truth()
        return {
            "seed": seed,
            "outcome": "success" if ending_of(records, fault, "").outcome is Outcome.SUCCESS else "failure",
            "stages": [[r.name, r.result.outcome, r.result.reason.name, r.result.elapsed] for r in records],
            "fault": "" if fault is None else f"{fault.code.name}: {fault}",
            "depth": truth.depth,
            "switch_closed": bool(truth.switch_closed),
            "is_void": bool(truth.is_void),
            "simulated": wired.bench.now(),
            "wall": time.monotonic() - began,
            "largest_torque_rate": wired.bench.largest_rate(),
            "loop": figures,
        }


def main() -> None:
    """Print the results of the insertions."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--host", default="127.0.0.1", help="address of the loopback that arm and hand get")
    parser.add_argument("--seed", type=int, default=2, help="of the first insertion")
    parser.add_argument("--seeds", type=int, default=1, help="how many, one insertion each")
    parser.add_argument("--set", action="append", default=[])
    args = parser.parse_args()
    counts = {"seeds": 0, "success": 0, "success_of_the_plain_cell": 0, "same": 0, "void": 0, "wrong_success": 0}
    plain = load(sets=["sim.pace=max", "reality.scale=0.0", *args.set]).cell
    for seed in range(args.seed, args.seed + args.seeds):
        row = run_trial(plain, seed)
        try:
            told = inserted(args.host, seed, args.set)
        except CellError as error:  # a device could not be opened
            told = {"seed": seed, "outcome": "failure", "fault": str(error), "switch_closed": False, "is_void": False}
        told["plain"] = row.outcome
        counts["seeds"] += 1
        counts["success"] += told["outcome"] == "success"
        counts["success_of_the_plain_cell"] += row.outcome == "success"
        counts["same"] += told["outcome"] == row.outcome
        counts["void"] += told["is_void"]
        counts["wrong_success"] += told["outcome"] == "success" and not told["switch_closed"]
        print(json.dumps(told), flush=True)
    if args.seeds > 1:
        print(json.dumps(counts))


if __name__ == "__main__":
    main()
