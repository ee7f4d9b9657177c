"""A PLC on the library canopen that knows the cell by its EDS alone: runs insert_peg COUNT times and counts the answers.

    python canopen_client.py INTERFACE CHANNEL EDS NODE CODE COUNT

INTERFACE and CHANNEL are python-can's, with HOST:PORT before the channel of socketcand; NODE is the cell's node-ID, CODE
that of `insert_peg`.
"""

import sys
import threading
import time

import canopen

PLC_NODE, BEAT, CYCLE, PATIENCE = 1, 0.1, 0.01, 60.0
SUCCESS = 1


class Plc:
    """The PLC's node: its heartbeat, its RPDOs, and the cell's answers in its TPDOs."""

    def __init__(self, eds: str, node: int, **bus: object) -> None:
        self.network = canopen.Network()
        self.network.connect(**bus)
        self.beat = self.network.send_periodic(0x700 + PLC_NODE, [5], BEAT)
        self.cell = self.network.add_node(canopen.RemoteNode(node, eds))
        self.cell.sdo.RESPONSE_TIMEOUT = 10.0
        self.told: dict[str, int] = {}
        self.has_news = threading.Event()
        self.cell.nmt.state = "PRE-OPERATIONAL"
        self.cell.tpdo.read()
        self.cell.rpdo.read()
        for pdo in self.cell.tpdo.values():
            pdo.add_callback(self.hear)
        self.cell.nmt.state = "OPERATIONAL"
        self.values = dict.fromkeys(("life", "sequence", "code", "recipe", "acknowledge", "lease"), 0)
        self.cycle(sequence=self.cell.sdo["report"]["report_sequence"].raw)

    def hear(self, pdo: canopen.pdo.PdoMap) -> None:
        for variable in pdo:
            self.told[variable.name.rpartition(".")[2]] = variable.raw
        self.has_news.set()

    def send(self, number: int) -> None:
        """Send an RPDO as the values stand."""
        for variable in self.cell.rpdo[number]:
            variable.raw = self.values[variable.name.rpartition(".command_")[2]]
        self.cell.rpdo[number].transmit()

    def cycle(self, **changes: int) -> None:
        """Count life up and send what a PLC sends in every cycle."""
        self.values.update(changes, life=self.values["life"] % 0xFFFF + 1)
        self.send(1)
        self.has_news.wait(CYCLE)
        self.has_news.clear()

    def run(self, code: int) -> bool:
        """Run a program; return whether it succeeded and its result was held until it was acknowledged."""
        number = (self.values["sequence"] + 1) % 0x10000
        self.cycle(sequence=number, code=code)
        deadline = time.monotonic() + PATIENCE
        while self.told.get("report_sequence") != number or not self.told.get("report_result"):
            if time.monotonic() > deadline:
                sys.stdout.write(f"{number}: no result: {self.told}, NMT {self.cell.nmt.state}\n")
                return False
            self.cycle()
        is_done = self.told["report_result"] == SUCCESS
        self.values["acknowledge"] = number
        self.send(2)
        while self.told["report_result"] and time.monotonic() < deadline:
            self.cycle()
        return is_done and not self.told["report_result"]


def main() -> None:
    interface, channel, eds, node, code, count = sys.argv[1:]
    bus: dict[str, object] = {"interface": interface, "channel": channel}
    if interface == "socketcand":
        place, _, channel = channel.rpartition("/")
        host, _, port = place.rpartition(":")
        bus = {"interface": interface, "host": host, "port": int(port), "channel": channel}
    plc = Plc(eds, int(node), **bus)
    done = sum(plc.run(int(code)) for _ in range(int(count)))
    plc.beat.stop()
    plc.network.disconnect()
    sys.stdout.write(f"triggered {count} done {done}\n")


if __name__ == "__main__":
    main()
