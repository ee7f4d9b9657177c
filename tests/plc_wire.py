"""A PLC's words and bits on Modbus TCP, in any order: single writes, torn blocks, several requests in one segment."""

import socket
import struct

from cell.run.states import State
from plc_bridge.protocol.images import COMMAND, REPORT, CommandImage, command_words
from plc_bridge.protocol.messages import Control
from plc_bridge.protocol.registers import COILS, DISCRETE_INPUTS
from tests.plc_bytes import coil, word
from tests.quick_cell import CODE
from tests.sockets import PATIENCE, answer, frame
from tests.trouble import first, until


class Wire:
    """A Modbus TCP connection that sends any bytes, also several requests in one segment."""

    def __init__(self, address):
        self.socket = socket.create_connection(address, timeout=PATIENCE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self):
        self.socket.close()

    def ask(self, *pdus):
        """Send requests in one segment, and return the answers."""
        self.socket.sendall(b"".join(frame(pdu, n) for n, pdu in enumerate(pdus)))
        return [answer(self.socket)[2] for _ in pdus]

    def order(self, *commands):
        """Send (sequence, code) pairs, each in a request of its own, in one segment."""
        return self.ask(*(struct.pack(">BHHBHH", 16, 1, 2, 4, *command) for command in commands))

    def coil(self, name, value):
        self.ask(coil(COILS[name], value))

    def report(self):
        (answer,) = self.ask(struct.pack(">BHH", 4, REPORT.start, REPORT.words))
        return REPORT.read(struct.unpack(f">{REPORT.words}H", answer[2:]))

    def bits(self):
        """Return the names of the discrete inputs that are 1, without `ready`, which belongs to the cell."""
        (answer,) = self.ask(struct.pack(">BHH", 2, 0, len(DISCRETE_INPUTS)))
        return {name for name, place in DISCRETE_INPUTS.items() if answer[2] >> place & 1} - {"ready"}

    def until(self, is_met):
        """Return the first report for which `is_met` holds."""
        return first(self.report, is_met)

    def answer(self, sequence):
        """Return the report that first answers a number."""
        return self.until(lambda report: report.answered == sequence)


def block(wire, life, life_tail=None, **what):
    """Write the whole command block, torn where its tail is given."""
    image = CommandImage(life=life, life_tail=life if life_tail is None else life_tail, **what)
    words = command_words(image)
    wire.ask(struct.pack(f">BHHB{len(words)}H", 16, COMMAND.start, len(words), 2 * len(words), *words))


def stopped(plc):
    """Bring the cell into its state STOPPED, and leave the number 2 behind."""
    plc.order((1, Control.NONE), (2, Control.STOP))
    return plc.until(lambda report: report.state == State.STOPPED)


def ladder(plc):
    """Let a connection be that of a plain ladder, which has only its code in the block."""
    plc.ask(word(2, CODE))


def until_bits(plc, *names):
    until(lambda: plc.bits() == set(names))
