"""A CANopen node and its bridge without a bus: tests pass frames in, sent frames go to a list, and time stands still."""

from drivers.transport.wires import CanFrame
from plc_bridge.bridge import Bridge
from plc_bridge.canopen.node import CanopenNode
from plc_bridge.config import CanConfig, PlcConfig
from plc_bridge.protocol.registers import Parameter, table
from tests.scan_thread import take

NODE, PLC, PROGRAM = 16, 1, 100
PARAMETERS = (Parameter("search.speed", "m/s", 1e-4, 0.001, 0.5, "peak speed"),)
REGISTERS = table({PROGRAM: "insert_peg"}, PARAMETERS)
PLACES = {register.name: register for register in REGISTERS}
START, STOP, PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130
CONFIG = CanConfig(interface="virtual", channel="rig", node_id=NODE, plc_node=PLC, plc_timeout=0.5)


class Rig:
    """The node, seen from its bus."""

    def __init__(self, config=CONFIG):
        self.now = 100.0
        self.sent = []
        self.bridge = Bridge(PlcConfig(), {PROGRAM: "insert_peg"}, PARAMETERS, now=lambda: self.now)
        self.node = CanopenNode(config, REGISTERS, self.bridge, self.sent.append)
        self.node.boot()

    def take(self, cob=None):
        """Return the data of the frames sent since the last call; with `cob`, only of those with this COB-ID."""
        sent, self.sent[:] = list(self.sent), []
        return [frame.data for frame in sent if cob is None or frame.id == cob]

    def give(self, cob, data=b""):
        self.node.receive(CanFrame(cob, bytes(data)), self.now)

    def wait(self, seconds, step=1 / 128):
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now = min(self.now + step, end)
            self.node.tick(self.now)

    def nmt(self, command, node=NODE):
        self.give(0, [command, node])

    def beat(self, state=5):
        self.give(0x700 + PLC, [state])

    def ask(self, request):
        self.take()
        self.give(0x600 + NODE, request)
        answers = self.take(0x580 + NODE)
        return answers[0] if answers else None

    def read(self, index, subindex=0):
        """Return the value of a short object by SDO, or the abort code, negative."""
        answer = self.ask(bytes([0x40]) + index.to_bytes(2, "little") + bytes([subindex]) + bytes(4))
        value = int.from_bytes(answer[4:], "little")
        return -value if answer[0] == 0x80 else value

    def write(self, index, subindex, value, size):
        """Return 0 if a short object could be written by SDO, else the abort code."""
        head = bytes([0x23 | 4 - size << 2]) + index.to_bytes(2, "little") + bytes([subindex])
        answer = self.ask(head + value.to_bytes(4, "little", signed=value < 0))
        return 0 if answer[0] == 0x60 else int.from_bytes(answer[4:], "little")

    def command(self, life, sequence, code=0, recipe=0):
        self.give(0x200 + NODE, b"".join(v.to_bytes(2, "little") for v in (life, sequence, code, recipe)))

    def start(self):
        """Bring the node up, adopt number 1, send command 2; return what reaches the scan thread."""
        self.nmt(START)
        self.command(1, 1)
        self.command(2, 2, PROGRAM, 3)
        return take(self.bridge)
