"""A whole insertion through the maker's client library and protocol: `python -m tests.franka.insertion`.

Prints one line of JSON: how it ended by the cell and in truth, and how the torque loop kept its time.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from cell.assembly import Cell, _skin, _switch, opened
from cell.config import load
from drivers.arm import FrankaArm, FrankaArmConfig
from drivers.errors import CellError
from drivers.gripper import FrankaGripper, FrankaGripperConfig
from skills.catalogue import CATALOGUE
from skills.flow import StageRecord
from tests.franka.simulated import Seen, served


def inserted(
    host: str, seed: int, sets: Sequence[str] = (), disturb: Callable[[str, FrankaArm], None] = lambda stage, arm: None
) -> dict[str, Any]:
    """Run `insert_peg` with arm and hand on `host`, an address of the loopback; return what `main` prints.

    `disturb` is called in every scan with the stage and the arm.
    """
    config = load(sets=["sim.pace=max", f"sim.seed={seed}", "switch.kind=serial", "switch.port=emulated", *sets]).cell
    franka = FrankaArmConfig(kind="franka", host=host, collision_torque=60.0, collision_force=60.0, realtime="ignore")
    with served(config, host) as (world, _):
        seen: Any = Seen(world)
        skin, clock = _skin(config, seen, seen.draw.skin)
        switch, clock, boards = _switch(config, seen, clock)
        arm, gripper = FrankaArm(franka, clock), FrankaGripper(FrankaGripperConfig(kind="franka", host=host))
        cell = Cell(config, clock, arm, gripper, skin, switch, world.world.restock, boards=boards)
        began, fault = time.monotonic(), ""
        records: list[StageRecord] = []
        with opened(cell):
            try:
                ctx = cell.context(seed)
                ctx.record = lambda seen, setpoint: disturb(ctx.stage, arm)
                records = CATALOGUE["insert_peg"].run(config.skill_set(), ctx)
            except CellError as error:
                fault = f"{error.code.name}: {error}"
            figures, truth = asdict(arm.figures()), world.world.truth()
            world.horizon = math.inf
        return {
            "stages": {r.name: [r.result.outcome, r.result.reason.name, r.result.elapsed] for r in records},
            "fault": fault,
            "depth": truth.depth,
            "switch_closed": bool(truth.switch_closed),
            "is_void": bool(truth.is_void),
            "simulated": world.now(),
            "wall": time.monotonic() - began,
            "largest_torque_rate": world.largest_rate,
            "loop": figures,
        }


def main() -> None:
    """Print what came of one insertion."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--host", default="127.0.0.1", help="address of the loopback that arm and hand get")
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--set", action="append", default=[])
    args = parser.parse_args()
    print(json.dumps(inserted(args.host, args.seed, args.set)))


if __name__ == "__main__":
    main()
