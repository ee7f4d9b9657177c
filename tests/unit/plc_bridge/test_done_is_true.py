"""Done only after a run with a new number has ended, and its result is that run's: three links, 100,000 random steps.

A PLC by registers, a plain ladder by coils and a PLC on CAN share one cell; connections, heartbeats, signs of life and
whole PLCs are lost, writes come torn, late, twice and word by word, and CAN frames hold anything at all. What each PLC
reads is compared with what the scan thread really began and ended, kept in a list of its own.
"""

import random
from collections import Counter
from dataclasses import dataclass

import pytest

from drivers.transport.wires import CanFrame
from plc_bridge.bridge import Bridge
from plc_bridge.canopen_node import CanopenNode, NmtState
from plc_bridge.config import CanConfig, PlcConfig
from plc_bridge.images import Diagnostics
from plc_bridge.messages import Control, Refusal, Report, Result
from plc_bridge.refusals import STOPS
from plc_bridge.registers import COILS, DISCRETE_INPUTS, table
from plc_bridge.station import LinkStation, LinkWords

STEPS, SEEDS = 25_000, (1, 2, 3, 4)
PROGRAMS = {100: "insert_peg", 101: "grasp_from_rack"}
REGISTERS = table(PROGRAMS)
CODES = [0, 1, 3, 4, 5, 8, 9, 77, 101]
LIFE, SEQUENCE, CODE, RECIPE, ACKNOWLEDGE, LEASE, VERSION, TAIL = 0, 1, 2, 3, 4, 5, 6, 40
NODE, PLC = 16, 1
ENDINGS = [Result.SUCCESS, Result.SUCCESS, Result.FAILURE, Result.FAULT]


@dataclass
class Run:
    """A program that the scan thread began."""

    host: str
    sequence: int
    began: int
    result: Result = Result.NONE


@dataclass(frozen=True)
class Asked:
    """A number that a PLC wrote as a new one."""

    step: int
    code: int
    is_first: bool
    """It was the first number of its connection, which may only name a run that is there already."""


class Cell:
    """Bridge, node and scan thread, and beside them the list of what really ran."""

    def __init__(self, seed):
        self.rng, self.now, self.step, self.seen = random.Random(seed), 0.0, 0, Counter()
        self.bridge = Bridge(PlcConfig(life_timeout=1.0, lease_timeout=2.0), PROGRAMS, now=lambda: self.now)
        self.frames, self.runs, self.running, self.report = [], [], None, Report(state=4)
        can = CanConfig(interface="virtual", channel="line", node_id=NODE, plc_node=PLC, plc_timeout=0.5)
        self.node = CanopenNode(can, REGISTERS, self.bridge, self.frames.append)
        self.node.boot()
        self.links = [Registers(self), Ladder(self), CanPlc(self)]

    def turn(self):
        self.step += 1
        action = self.rng.choices((self.act, self.scan, self.end, self.wait), (60, 25, 12, 3))[0]
        action()
        for link in self.links:
            link.check()

    def act(self):
        self.rng.choice(self.links).act()

    def wait(self):
        self.now += self.rng.choice([0.01, 0.1, 0.1, 0.3, 0.9, 2.5])
        self.node.tick(self.now)

    def scan(self):
        self.now += 0.01
        self.node.tick(self.now)
        command = self.bridge.poll()
        if command is None:
            pass
        elif command.code in PROGRAMS:
            if self.running is not None or self.rng.random() < 0.1:
                self.bridge.refuse(command, Refusal.NOT_READY)
            else:
                self.bridge.accept(command)
                self.running = Run(command.source.partition(":")[0], command.sequence, self.step)
                self.runs.append(self.running)
                self.report = Report(sequence=command.sequence, state=6)
        elif command.code in STOPS or command.code == Control.LOST:
            self.bridge.accept(command)
            self.finish(Result.ABORTED)
        elif self.running is None or self.rng.random() < 0.5:
            self.bridge.accept(command)
        else:
            self.bridge.refuse(command, Refusal.NOT_READY)
        self.bridge.publish(self.report)

    def end(self):
        self.finish(self.rng.choice(ENDINGS))
        self.bridge.publish(self.report)

    def finish(self, result):
        if self.running is not None:
            self.running.result = result
            self.report = Report(sequence=self.running.sequence, state=17, result=result)
            self.running = None

    def last_run(self, host, sequence):
        return next((run for run in reversed(self.runs) if (run.host, run.sequence) == (host, sequence)), None)

    def judge(self, host, sequence, result, asked):
        """Hold a result of a program that a PLC reads under its number against the run that it claims to be of."""
        run = self.last_run(host, sequence)
        assert run is not None, f"{host}: {result!r} of {sequence}, which never ran"
        if asked.is_first:
            assert run.began < asked.step, f"{host}: {sequence} ran although it was the first of its connection"
        else:
            assert run.began > asked.step, f"{host}: {result!r} of {sequence} is that of an earlier run"
        assert run.result is result, f"{host}: {result!r} of {sequence}, which ended in {run.result!r}"
        self.seen[host, result.name] += 1


class Numbered:
    """What both PLCs with numbers do; `asked` has every number that it wrote as a new one."""

    host = ""

    def __init__(self, cell):
        self.cell, self.rng = cell, cell.rng
        self.number, self.life, self.code, self.asked, self.is_new = 0, 0, 0, {}, True
        self.numbers = set()

    def ask(self, number, code):
        """Note a number that is written whole; the first one of a connection is never a command."""
        if number not in self.numbers:
            self.asked[number] = Asked(self.cell.step, code, self.is_new)
        self.numbers.add(number)
        self.is_new = False

    def next(self):
        self.number = (self.number + 1) % 0x10000
        return self.number

    def beat(self):
        self.life = self.life % 0xFFFF + 1
        return self.life

    def restart(self):
        self.number, self.is_new = self.rng.randrange(0x10000), True
        self.numbers.clear()

    def read(self, sequence, result):
        """Take what the PLC reads under a number; that it wrote the number is what makes the answer its own."""
        asked = self.asked.get(sequence)
        if asked is not None and result in ENDINGS and (asked.code in PROGRAMS or asked.code == Control.NONE):
            self.cell.judge(self.host, sequence, result, asked)


class Registers(Numbered):
    """A PLC on Modbus TCP."""

    host = "registers"

    def __init__(self, cell):
        super().__init__(cell)
        self.connections = 0
        self.connect()

    def connect(self):
        self.connections += 1
        self.source, self.is_new, self.uses_tail = f"{self.host}:{self.connections}", True, False
        self.cell.bridge.opened(self.source, self.host)
        self.station = LinkStation(self.cell.bridge, LinkWords(self.source), Diagnostics(), warn=lambda *_: None)

    def act(self):
        name = self.rng.choices(
            ("order", "repeat", "torn", "late", "word", "acknowledge", "lease", "reconnect", "restart_all", "stop"),
            (30, 15, 6, 4, 6, 12, 3, 3, 1, 3),
        )[0]
        getattr(self, name)()

    def write(self, number, code, tail=None):
        life = self.beat()
        block = [life, number, code, 0]
        self.station.write_words(TAIL, [life if tail is None else tail])
        self.uses_tail = True
        self.ask(number, code)
        self.code = code
        self.station.write_words(LIFE, block)
        if tail is not None:
            self.station.write_words(TAIL, [life])

    def order(self):
        self.write(self.next(), 100 if self.rng.random() < 0.6 else self.rng.choice(CODES))

    def repeat(self):
        life = self.beat()
        self.station.write_words(TAIL, [life])
        self.station.write_words(LIFE, [life])

    def torn(self):
        """Write the head with a number and the code of another, then the whole block."""
        if not self.uses_tail:  # the cell could not know
            return
        number, life = self.next(), self.beat()
        self.ask(number, 100)
        self.station.write_words(LIFE, [life, number, self.rng.choice(CODES)])
        self.station.write_words(CODE, [100])
        self.station.write_words(TAIL, [life])
        self.code = 100

    def late(self):
        number = (self.number - self.rng.randrange(1, 250)) % 0x10000
        if number in self.numbers:
            life = self.beat()
            self.station.write_words(TAIL, [life])
            self.station.write_words(LIFE, [life, number, 100])
            self.code = 100

    def word(self):
        """Write the number alone: it goes with the code that is there."""
        number = self.next()
        self.ask(number, self.code)
        self.station.write_words(SEQUENCE, [number])

    def acknowledge(self):
        self.station.write_words(ACKNOWLEDGE, [self.rng.choice([self.number, self.number, self.rng.randrange(9)])])

    def lease(self):
        self.station.write_words(LEASE, [self.rng.choice([0, 1, 3, 3])])

    def reconnect(self):
        self.cell.bridge.closed(self.source)
        self.connect()
        self.code = 0
        if self.rng.random() < 0.5:
            self.write(self.number, self.rng.choice([0, 100]))

    def restart_all(self):
        self.restart()
        self.reconnect()

    def stop(self):
        self.station.write_bits(COILS["stop"], [True])
        self.station.write_bits(COILS["stop"], [False])

    def check(self):
        report = self.cell.bridge.report_for(self.source)
        if not self.is_new and report.code in PROGRAMS:
            self.read(report.sequence, Result(report.result))
        if not self.is_new:
            self.read(report.answered, Result(report.answered_result))


class Ladder:
    """A plain ladder on Modbus TCP, which knows nothing but its bits; `edge` is the step of its last rising edge."""

    host = "ladder"

    def __init__(self, cell):
        self.cell, self.rng, self.connections = cell, cell.rng, 0
        self.connect()

    def connect(self):
        self.connections += 1
        self.source, self.edge, self.execute = f"{self.host}:{self.connections}", None, None
        self.cell.bridge.opened(self.source, self.host)
        self.station = LinkStation(self.cell.bridge, LinkWords(self.source), Diagnostics(), warn=lambda *_: None)
        self.station.write_words(CODE, [100])

    def act(self):
        name = self.rng.choices(("switch", "stop", "reset", "all", "reconnect", "close"), (50, 3, 8, 5, 3, 1))[0]
        getattr(self, name)()

    def put(self, value):
        if value and self.execute is False:
            self.edge = self.cell.step
        elif value and self.execute is None:
            self.edge = None  # nobody saw it rise
        self.execute = value

    def switch(self):
        value = not self.execute if self.rng.random() < 0.8 else self.rng.random() < 0.5
        self.put(value)
        self.station.write_bits(COILS["execute"], [value])

    def stop(self):
        self.station.write_bits(COILS["stop"], [True])
        self.station.write_bits(COILS["stop"], [False])

    def reset(self):
        self.station.write_bits(COILS["reset"], [self.rng.random() < 0.5])

    def all(self):
        bits = [self.rng.random() < 0.5, False, self.rng.random() < 0.5]
        self.put(bits[0])
        self.station.write_bits(0, bits)

    def reconnect(self):
        self.cell.bridge.closed(self.source)
        self.connect()

    def close(self):
        """Be away for longer than the signs of life may stay away; it does not know that it was taken for lost."""
        self.cell.now += 2.5

    def check(self):
        inputs = self.cell.bridge.discrete_inputs(self.source)
        bits = {name: inputs[place] for name, place in DISCRETE_INPUTS.items()}
        assert sum(bits[name] for name in ("busy", "done", "error", "command_aborted")) <= 1
        if bits["done"]:
            assert self.edge is not None, "done without an edge"
            run = next((run for run in reversed(self.cell.runs) if run.host == self.host), None)
            assert run is not None
            assert run.began >= self.edge, "done of a run before the edge"
            assert run.result is Result.SUCCESS
            self.cell.seen[self.host, "SUCCESS"] += 1


class CanPlc(Numbered):
    """A PLC on CAN; it reads TPDO 1 as it was sent last."""

    host = "node 1"

    def __init__(self, cell):
        super().__init__(cell)
        self.told = (0, 0)
        self.start()

    @property
    def is_up(self):
        """The node's heartbeat says that it is operational."""
        return self.cell.node.state is NmtState.OPERATIONAL

    def give(self, cob, data):
        self.cell.node.receive(CanFrame(cob, bytes(data)), self.cell.now)

    def pdo(self, cob, *words):
        self.give(cob + NODE, b"".join(word.to_bytes(2, "little") for word in words))

    def act(self):
        name = self.rng.choices(
            ("order", "repeat", "late", "acknowledge", "beat_on", "start", "leave", "reset", "anything", "stop"),
            (30, 15, 4, 12, 25, 8, 1, 1, 6, 2),
        )[0]
        getattr(self, name)()

    def write(self, number, code):
        if self.is_up:
            self.ask(number, code)
        self.pdo(0x200, self.beat(), number, code, 0)
        self.code = code

    def order(self):
        self.write(self.next(), 100 if self.rng.random() < 0.6 else self.rng.choice(CODES))

    def repeat(self):
        self.write(self.number, self.code)

    def late(self):
        number = (self.number - self.rng.randrange(1, 250)) % 0x10000
        if number in self.numbers:
            self.pdo(0x200, self.beat(), number, 100, 0)
            self.code = 100

    def acknowledge(self):
        self.pdo(0x300, self.rng.choice([self.number, 7]), self.rng.choice([0, 0, 1, 3, 3, 3, 4, 500]))

    def beat_on(self):
        self.give(0x700 + PLC, [5])

    def start(self):
        self.give(0, [1, NODE])

    def leave(self):
        self.give(0, [self.rng.choice([2, 128]), NODE])

    def reset(self):
        self.give(0, [self.rng.choice([129, 130]), NODE])
        self.restart()

    def anything(self):
        """Send a frame that holds anything, but no command under a number that nobody noted."""
        cob = self.rng.choice([0x080, 0x100, 0x180 + NODE, 0x300 + NODE, 0x500 + NODE, 0x600 + NODE, 0x700, 0x77F])
        data = self.rng.randbytes(self.rng.randrange(9))
        if cob != 0x600 + NODE or data[1:3] not in (b"\x00\x20", b"\x17\x10", b"\x16\x10", b"\x29\x10"):
            self.give(cob, data)

    def stop(self):
        self.give(0x400 + NODE, [1])

    def check(self):
        for frame in self.cell.frames:
            if frame.id == 0x180 + NODE:
                self.told = (int.from_bytes(frame.data[:2], "little"), int.from_bytes(frame.data[4:6], "little"))
        self.cell.frames.clear()
        sequence, result = self.told
        if self.is_up and not self.is_new and sequence in self.asked:
            self.read(sequence, Result(result))


@pytest.mark.parametrize("seed", SEEDS)
def test_what_a_plc_reads_is_true(seed):
    cell = Cell(seed)
    for _ in range(STEPS):
        cell.turn()
    for host in ("registers", "ladder", "node 1"):
        assert cell.seen[host, "SUCCESS"] > 20
