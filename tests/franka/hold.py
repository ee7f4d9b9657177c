"""How the torque loop keeps its time: `python -m tests.franka.hold [--seconds 60] [--neighbours 4]`.

The arm holds a setpoint against a server that waits for nobody: a state leaves every millisecond of wall time, as far
as this machine can, and torques that come later count as lost. Prints one line of JSON.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import asdict
from typing import Any

from cell.config.load import load
from tests.franka.simulated import address, arm_at, served
from tests.setpoints import risen


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0, help="of wall time")
    parser.add_argument("--neighbours", type=int, default=0, help="number of busy processes beside it")
    args = parser.parse_args()
    seconds, busy = args.seconds, [sys.executable, "-c", "while True: pass"]
    neighbours = [subprocess.Popen(busy) for _ in range(args.neighbours)]
    try:
        print(json.dumps({"neighbours": args.neighbours, "wall": seconds, **held(seconds)}))
    finally:
        for neighbour in neighbours:
            neighbour.kill()


def held(seconds: float) -> dict[str, Any]:
    """Hold a setpoint for so long, s of wall time, and return the figures of the loop."""
    host = address(1)
    with served(load(sets=["reality.scale=0.0"]).cell, host) as (world, server):
        arm = arm_at(host, world.world.arm, world)
        arm.open()
        arm.follow(risen(arm.read(), 0.01, world.now() + seconds))
        server.is_patient = False
        time.sleep(seconds)  # The loop is measured against wall time; nothing here waits for an event.
        found = {"simulated": world.now(), **asdict(arm.figures())}
        arm.close()
    return found


if __name__ == "__main__":
    main()
