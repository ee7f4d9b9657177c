"""Cost of an OPC UA client for the scan: intervals between scans with and without one that polls, in turns.

    python -m tests.opcua_load [--pairs 8] [--seconds 20] [--rate 10]

prints the 99th percentile of each window, and the median over the pairs of their quotient.
"""

import argparse
import asyncio
import json
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from asyncua import Client, ua

from cell.config.load import load
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import assemble, opened
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.supervisor import Supervisor
from plc_bridge.bridge import Bridge


class Stamped(Bridge):
    """A bridge that notes when it was given each report."""

    def publish(self, report):
        super().publish(report)
        self.stamps.append(time.perf_counter())


async def poll(url, rate):
    """Read every variable of the report in one request, at a rate, while the last line of standard input says so."""
    is_on = threading.Event()

    def listen():
        for line in sys.stdin:
            is_on.set() if line.strip() == "on" else is_on.clear()

    threading.Thread(target=listen, daemon=True).start()
    async with Client(url) as client:
        index = await client.get_namespace_index("urn:tactile-insertion-cell")
        nodes = await client.get_node(ua.NodeId("Cell.Report", index)).get_children()
        sys.stdout.write(f"reads {len(nodes)} values\n")
        sys.stdout.flush()
        while True:
            if is_on.is_set():
                await client.read_values(nodes)
            await asyncio.sleep(1.0 / rate)


def measure(bridge, seconds):
    bridge.stamps = []
    time.sleep(seconds)
    return float(np.percentile(np.diff(bridge.stamps), 99.0))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--pairs", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--poll", default="")
    args = parser.parse_args()
    if args.poll:
        asyncio.run(poll(args.poll, args.rate))
    loaded = load(sets=["reality.scale=0.0", "plc.modbus.port=0", "plc.opcua_anonymous=true"])
    bridge, stop = Stamped(loaded.cell.plc, PROGRAMS, PARAMETERS, opcua=("127.0.0.1", 0)), threading.Event()
    bridge.stamps = []
    with tempfile.TemporaryDirectory() as folder, opened(assemble(loaded.cell)) as cell:
        journal = Journal(Path(folder))
        journal.open()
        supervisor = Supervisor(cell, loaded, bridge, journal, stop)
        supervisor.scan()
        bridge.start()
        scan = threading.Thread(target=supervisor.serve)
        scan.start()
        host, port = bridge.opcua_address
        command = [
            sys.executable,
            "-m",
            "tests.opcua_load",
            "--rate",
            str(args.rate),
            "--poll",
            f"opc.tcp://{host}:{port}/",
        ]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as client:
            sys.stdout.write(client.stdout.readline())
            quotients = []
            for pair in range(args.pairs):
                p99 = {}
                for state in ("off", "on") if pair % 2 else ("on", "off"):
                    client.stdin.write(f"{state}\n")
                    client.stdin.flush()
                    p99[state] = measure(bridge, args.seconds)
                quotients.append(p99["on"] / p99["off"])
                sys.stdout.write(json.dumps({key: round(1e3 * value, 3) for key, value in p99.items()}) + "\n")
                sys.stdout.flush()
            client.kill()
        stop.set()
        scan.join()
        journal.close()
        bridge.close()
    sys.stdout.write(f"median quotient {statistics.median(quotients):.3f}\n")


if __name__ == "__main__":
    main()
