"""An HMI beside the PLC: it shows the state of the cell, never asks for the lease, and may stop.

    python hmi.py HOST PORT [--stop-at RUN]

It writes nothing but the stop coil, so it neither runs nor disturbs what the PLC runs.
"""

import argparse
import time

from pymodbus.client import ModbusTcpClient

STATE, RESULT, STAGE, PROGRESS, RUN, STOP_COIL = 6, 5, 8, 10, 12, 1  # addresses of `cell map`
EXECUTE = 6


def main() -> None:
    """Poll ten times a second until the cell is gone; stop run `--stop-at` once, when it is under way."""
    parser = argparse.ArgumentParser()
    parser.add_argument("host")
    parser.add_argument("port", type=int)
    parser.add_argument("--stop-at", type=int, default=0, help="number of the run to stop")
    args = parser.parse_args()
    has_stopped, shown = False, ""
    with ModbusTcpClient(args.host, port=args.port) as client:
        while client.connected:
            words = client.read_input_registers(0, count=RUN + 2).registers
            run = words[RUN] << 16 | words[RUN + 1]
            told = f"run {run} state {words[STATE]} stage {words[STAGE]} progress {words[PROGRESS]} %"
            if told != shown:
                print(told, flush=True)
                shown = told
            if run == args.stop_at and words[STATE] == EXECUTE and not has_stopped:
                client.write_coil(STOP_COIL, True)
                client.write_coil(STOP_COIL, False)
                has_stopped = True
            time.sleep(0.1)


if __name__ == "__main__":
    main()
