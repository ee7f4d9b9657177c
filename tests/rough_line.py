"""A rough line: PLCs of every kind that restart, freeze, repeat, come late and lose answers, on one cell, byte by byte.

A step is a name, the number of a client and a random number, so that a list of steps can be repeated and printed.

These must hold after every step:

1. A result belongs to the run that this number started: the run began after the program requested it, and ended like this.
2. An answer does not change once it is given: a number keeps its result until it is acknowledged, one that was refused
   never runs, and one that ran is not refused.
3. While anybody holds a stop nothing begins, and after a stop, whoever sent it under whatever number, nothing runs.
4. Nothing runs twice: one run for each number of a program.
5. Nothing is lost without a word: every new number is answered, the end of a run is shown to who asked for it, and
   whoever runs holds the lease.
"""

import random
import struct
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from plc_bridge.protocol.images import CommandImage, command_words
from plc_bridge.protocol.messages import Refusal, Result
from plc_bridge.protocol.registers import DISCRETE_INPUTS
from tests.plc_bytes import NODE, PLC, PROGRAMS, READ_INPUTS, STOPS, Can, Cell, Client, Rtu, Run, Tcp, block, coil, word

Step = tuple[str, int, int]
Block = tuple[int, int, int]
"""Life counter, number, code."""

ACKNOWLEDGE, LEASE = 4, 5
CODES = (100, 100, 100, 100, 101, 1, 1, 4, 5, 9, 50, 77)
"""Programs, controls, and one that does not exist."""
ENDINGS = (Result.SUCCESS, Result.SUCCESS, Result.FAILURE)
LATE_IN_A_ROW = 2
"""Old blocks that a line brings in a row, at most; see `sequence_numbers.CONFIRMED`."""


@dataclass
class Program:
    """Memory of one program, from its start to its restart."""

    number: int
    life: int
    code: int = 0
    asked: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Step and code of the first write of each number."""
    sent: list[Block] = field(default_factory=list)
    results: dict[int, Result] = field(default_factory=dict)
    refused: set[int] = field(default_factory=set)
    stopped: set[int] = field(default_factory=set)
    """Numbers under which it has sent a stop, too, which has a result of its own."""


class Plc:
    """A PLC that counts: it follows the guide, but its line and its operator do not."""

    late = 0

    def __init__(
        self, line: "Line", name: str, client: Any, counts_life: bool = True, program: Program | None = None
    ) -> None:
        self.line, self.name, self.client, self.counts_life = line, name, client, counts_life
        self.program = program or Program(0, 0)
        if program is None:
            self.begin(0, 0)
        else:
            self.write(program.number, program.code)

    # Requests.

    def begin(self, number: int, life: int) -> None:
        """Begin a program: its first number comes with code 0."""
        self.program = Program(number, life if self.counts_life else 0)
        self.write(number, 0)

    def write(self, number: int, code: int, *, is_noted: bool = True) -> None:
        """Write a block as it is now."""
        program = self.program
        if self.counts_life:
            program.life = program.life % 0xFFFF + 1
        if is_noted:
            program.number, program.code = number, code
        program.asked.setdefault(number, (self.line.cell.step, code))
        program.sent.append((program.life, number, code))
        if code in STOPS:
            program.stopped.add(number)
        del program.sent[:-200]
        self.late = 0
        self.deliver(program.sent[-1])

    def deliver(self, each: Block) -> None:
        """Bring a block to the cell."""
        self.client.ask(block(*each))

    def order(self, n: int) -> None:
        """Send a command under the next number; it is answered."""
        number = (self.program.number + 1) % 0x10000
        code = CODES[n % len(CODES)]
        self.write(number, code)
        self.line.cell.scan()
        if self.is_up:
            report = self.read()
            if report is not None and report[1] != number:
                self.write(number, code)  # what is in doubt is answered with the next block
                self.line.cell.scan()
                report = self.read()
            assert report is None or report[1] == number, f"{self.name}: no answer to {number}: {report}"

    def repeat(self, n: int) -> None:
        """Send the block again, with a new life counter or as it is."""
        if n % 2 or self.late:
            self.write(self.program.number, self.program.code)
        else:
            self.deliver(self.program.sent[-1])

    def lose(self, n: int) -> None:
        """Lose some blocks on their way."""
        self.program.life = (self.program.life + n % 5) % 0xFFFF if self.counts_life else 0

    def empty(self, n: int) -> None:
        """Take the code out of the block, as the function block does at the end of a run."""
        self.write(self.program.number, 0)

    def come_late(self, n: int) -> None:
        """Let an old block of this program arrive once more."""
        sent = self.program.sent
        old = sent[-1 - n % min(len(sent), 60)]
        if self.late and old[0] == sent[-1][0]:
            return  # an old block and the newest once more are what a program sends that starts anew
        if (old[2] == 0 and not self.counts_life) or self.late >= LATE_IN_A_ROW or old[2] in STOPS:
            return
        self.late += 1
        self.deliver(old)

    def ask_late(self, n: int) -> None:
        """Send a number again that was there, under another code."""
        number = (self.program.number - n % 250) % 0x10000
        if number in self.program.asked and number != self.program.number:
            self.write(number, 100, is_noted=False)

    def acknowledge(self, n: int) -> None:
        """Acknowledge the newest number, or any."""
        self.client.ask(word(ACKNOWLEDGE, self.program.number if n % 4 else n % 9))

    def lease(self, n: int) -> None:
        """Take or release the lease."""
        self.client.ask(word(LEASE, (0, 1, 3, 3)[n % 4]))

    def stop_by_code(self, n: int) -> None:
        """Stop under any number."""
        number = (self.program.number + (1, 0, -1, -200, n)[n % 5]) % 0x10000
        self.write(number, STOPS[n % 2], is_noted=0 < (number - self.program.number) % 0x10000 <= 0x8000)
        self.line.cell.scan()
        if self.is_up:
            assert self.line.cell.running is None, f"{self.name}: a stop under {number} did not stop"
        self.write(self.program.number, 0)

    # What happens to it.

    def restart(self, n: int) -> None:
        """Start anew on the open link, with a life counter that starts anew, too, or goes on."""
        life = (0, self.program.life, n)[n % 3]
        self.begin((0, 0, n % 5, n)[n % 4], life)

    def freeze(self, n: int) -> None:
        """Stand still for longer than the life time-out, then go on as if nothing had been."""
        self.line.cell.wait(1.4)
        self.write(self.program.number, self.program.code)

    def reconnect(self, n: int) -> None:
        """Lose the connection and open another."""
        self.client.close()
        self.line.stops.discard(self.name)
        self.client.open()
        del self.program.sent[:]  # an old block comes late over the connection that it was sent on
        if n % 2:
            self.write(self.program.number, self.program.code)
        else:
            self.restart(n // 2)

    def hold_stop(self, n: int) -> None:
        """Set the stop coil."""
        self.client.ask(coil(1, True))
        self.line.stops.add(self.name)
        self.line.cell.scan()
        assert self.line.cell.running is None

    def release_stop(self, n: int) -> None:
        """Let the stop coil fall, alone or with the others."""
        self.client.ask(coil(1, False) if n % 2 else bytes.fromhex("0F 0000 0003 01 00"))
        self.line.stops.discard(self.name)

    # Answers.

    @property
    def is_up(self) -> bool:
        """Whether what it sends arrives."""
        return True

    def read(self) -> tuple[int, int, int, int, int] | None:
        """Return sequence, answered, result, refusal and result of the answered number."""
        report = self.client.report()
        return report.sequence, report.answered, report.result, report.refusal, report.answered_result

    def check(self) -> None:
        """Hold what the program reads against what really ran."""
        said = self.read()
        if said is None:
            return
        sequence, answered, result, refusal, answered_result = said
        self.judge(sequence, Result(result))
        self.judge(answered, Result(answered_result))
        if answered in self.program.asked and refusal not in (Refusal.NONE, Refusal.LATE):
            self.program.refused.add(answered)

    def judge(self, number: int, result: Result) -> None:
        """Compare a result under a number that the program requested with the runs."""
        if result is Result.NONE or number not in self.program.asked:
            return
        step, code = self.program.asked[number]
        if code not in PROGRAMS:
            return
        run = self.line.run_of(self, number)
        if result is Result.REFUSED:
            return
        if run is None:
            is_of_a_stop = result is Result.SUCCESS and number in self.program.stopped
            assert is_of_a_stop or result is Result.ABORTED, (
                f"{self.name}: {result.name} of {number}, which never ran since step {step}"
            )
            return
        assert run.result is result, f"{self.name}: {result.name} of {number}, whose run ended in {run.result.name}"
        assert self.program.results.setdefault(number, result) is result, (
            f"{self.name}: {number} changed to {result.name}"
        )
        self.line.seen[self.name, result.name] += 1


class BlockPlc(Plc):
    """A PLC that writes the whole block with the life counter at both ends, so that torn ones are noticed."""

    def deliver(self, each: Block) -> None:
        """Write the 41 words in one request."""
        life, number, code = each
        words = command_words(CommandImage(life=life, sequence=number, code=code, life_tail=life))
        self.client.ask(struct.pack(f">BHHB{len(words)}H", 16, 0, len(words), 2 * len(words), *words))

    def tear(self, n: int) -> None:
        """Write the head with the next number and another's code, then the block whole."""
        program = self.program
        number, life = (program.number + 1) % 0x10000, program.life % 0xFFFF + 1
        self.client.ask(block(life, number, (101, 0, 77)[n % 3]))
        if n % 7 == 0:
            self.line.cell.wait(1.2)
        self.write(number, 100)


class JoinedPlc(Plc):
    """A PLC with two connections that share one link; now and then the second one writes."""

    def __init__(self, line: "Line", name: str, client: Tcp) -> None:
        self.other: Any = Heard(line, Tcp(line.cell, client.host))
        for each in (client, self.other):
            each.ask(word(LEASE, 2))
        super().__init__(line, name, client)

    def swap(self, n: int) -> None:
        """Write over the other connection from now on, or two programs at once over both."""
        self.client, self.other = self.other, self.client
        self.line.stops.discard(self.name)
        self.client.ask(coil(1, False))
        self.other.ask(coil(1, False))
        del self.program.sent[:]  # an old block comes late over the connection that it was sent on
        if n % 2 == 0:
            self.other.ask(block(n % 50, n % 300, 0))
        self.write(self.program.number, self.program.code)

    def reconnect(self, n: int) -> None:
        """Lose one of the two connections."""
        super().reconnect(n)
        self.client.ask(word(LEASE, 2))

    def stop_by_code(self, n: int) -> None:
        """Stop under the next number: under an old one, the other writer's number may stand in between."""
        super().stop_by_code(5 * n)

    def order(self, n: int) -> None:
        """Send a command; after a change of connections it is adopted only."""
        self.write((self.program.number + 1) % 0x10000, CODES[n % len(CODES)])
        self.line.cell.scan()


class GatewayPlc(Plc):
    """A PLC behind a gateway: blocks are kept, the newest is passed on when the gateway has its turn, if it changed."""

    pending: Block | None = None
    report: tuple[int, int, int, int, int] | None = None

    def deliver(self, each: Block) -> None:
        """Give a block to the gateway, where it replaces the one before."""
        self.pending = each

    def order(self, n: int) -> None:
        """Send the next command once the gateway has brought the answer to the last number."""
        self.forward(1)
        if self.report is not None and self.report[1] == self.program.number:
            self.write((self.program.number + 1) % 0x10000, CODES[n % len(CODES)])
        if n % 3:
            self.forward(n)

    def come_late(self, n: int) -> None:
        """Pass nothing on out of order: a gateway has one connection."""

    ask_late = come_late

    def stop_by_code(self, n: int) -> None:
        """Stop under the next number."""
        self.write((self.program.number + 1) % 0x10000, STOPS[n % 2])
        self.forward(1)
        self.line.cell.scan()
        assert self.line.cell.running is None

    def forward(self, n: int) -> None:
        """Take the gateway's turn: write what changed, or the same again, then read; an answer may be lost."""
        if self.pending is not None:
            super().deliver(self.pending)
        self.line.cell.scan()
        if n % 4:
            self.report = super().read()
            self.pending = self.pending if n % 5 == 0 else None

    def restart(self, n: int) -> None:
        """Start anew and wait for the answer to the first number, as the guide says."""
        super().restart(n)
        self.report = None
        self.forward(1)

    def read(self) -> tuple[int, int, int, int, int] | None:
        """Return what the gateway read last."""
        return self.report


class CanPlc(Plc):
    """A PLC on CAN, which reads TPDO 1 as it was sent last."""

    @property
    def is_up(self) -> bool:
        """Whether the node is operational."""
        return self.line.cell.node.state == 5

    def deliver(self, each: Block) -> None:
        """Send RPDO 1."""
        self.client.give(0x200 + NODE, struct.pack("<4H", *each, 0))

    def acknowledge(self, n: int) -> None:
        """Send RPDO 2."""
        self.client.give(0x300 + NODE, struct.pack("<2H", self.program.number if n % 4 else n % 9, (0, 0, 1, 3)[n % 4]))

    lease = acknowledge

    def leave(self, n: int) -> None:
        """Leave operational and come back."""
        self.client.nmt((2, 128)[n % 2])
        if n % 3:
            self.line.cell.scan()
        self.client.nmt(1)
        self.write(self.program.number, self.program.code)

    def reconnect(self, n: int) -> None:
        """Reset the cell's node."""
        self.client.nmt((129, 130)[n % 2])
        self.client.nmt(1)
        del self.program.sent[:]
        self.restart(n)

    def hold_stop(self, n: int) -> None:
        """Send the stop object."""
        self.client.give(0x400 + NODE, b"\x01")
        self.line.cell.scan()
        assert self.line.cell.running is None

    def release_stop(self, n: int) -> None:
        """Send any frame that is no command."""
        data = random.Random(n).randbytes(n % 9)
        cob = (0x080, 0x100, 0x180 + NODE, 0x500 + NODE, 0x700, 0x77F, 0x700 + PLC)[n % 7]
        self.client.give(cob, data if cob != 0x700 + PLC else b"\x05")

    def read(self) -> tuple[int, int, int, int, int] | None:
        """Return what came by TPDO 1; TPDO 4 is left alone."""
        for frame in self.line.cell.frames:
            if frame.id == 0x180 + NODE:
                self.told = struct.unpack("<4H", frame.data)
        self.line.cell.frames.clear()
        return (*self.told, 0) if self.is_up else None


class Ladder(Plc):
    """A plain ladder, which knows nothing but its bits; `edge` is the step of its last rising edge."""

    edge: int | None = None
    execute: bool | None = None

    def begin(self, number: int, life: int) -> None:
        """Write the code once and execute low."""
        self.client.ask(word(2, 100))
        self.put(False)

    def put(self, value: bool) -> None:
        """Write the coil execute."""
        if value and not self.execute:
            self.edge = self.line.cell.step if self.execute is False else None
        self.execute = value
        self.client.ask(coil(0, value))

    def order(self, n: int) -> None:
        """Turn the coil."""
        self.put(not self.execute)

    def repeat(self, n: int) -> None:
        """Write the coil again, as it is."""
        self.put(bool(self.execute))

    def empty(self, n: int) -> None:
        """Turn the coil reset."""
        self.client.ask(coil(2, bool(n % 2)))

    def lease(self, n: int) -> None:
        """Do nothing: a ladder has no lease of its own."""

    come_late = ask_late = acknowledge = stop_by_code = lose = lease

    def release_stop(self, n: int) -> None:
        """Let the stop coil fall, alone: the other coils are the ladder's own."""
        super().release_stop(1)

    def restart(self, n: int) -> None:
        """Start anew; the first write is 0."""
        self.begin(0, 0)

    def freeze(self, n: int) -> None:
        """Be away for longer than the signs of life may stay away, and write the coil as it was."""
        self.line.cell.wait(1.4)
        self.put(bool(self.execute))

    def reconnect(self, n: int) -> None:
        """Connect anew; the first write may be a 1, which has no edge."""
        self.client.close()
        self.line.stops.discard(self.name)
        self.client.open()
        self.execute = None
        self.client.ask(word(2, 100))
        self.put(bool(n % 2))

    def check(self) -> None:
        """Hold `done` against what ran since the edge."""
        bits = self.client.ask(READ_INPUTS)[2]
        is_set = {name: bool(bits >> place & 1) for name, place in DISCRETE_INPUTS.items()}
        assert sum(is_set[name] for name in ("busy", "done", "error", "command_aborted")) <= 1
        if is_set["done"]:
            run = self.line.last_of(self)
            assert self.edge is not None, "done without an edge"
            assert run is not None, "done, and nothing ran"
            assert run.began >= self.edge, "done of a run before the edge"
            assert run.result is Result.SUCCESS
            self.line.seen[self.name, "SUCCESS"] += 1


class Line:
    """Seven clients and a cell; a step names what one of them does or what happens to the cell."""

    def __init__(self) -> None:
        self.sent: list[str] = []
        self.cell, self.stops, self.seen = Cell(lease_timeout=0.2), set[str](), Counter[tuple[str, str]]()
        self.judged = 0
        self.connect(None)

    def connect(self, program: Program | None) -> None:
        """Let every client connect; the first one goes on with its program."""
        cell = self.cell
        self.stops.clear()
        self.plcs: list[Plc] = [
            BlockPlc(self, "10.0.0.1", Heard(self, Tcp(cell, "10.0.0.1")), program=program),
            Plc(self, "10.0.0.2", Heard(self, Tcp(cell, "10.0.0.2")), counts_life=False),
            JoinedPlc(self, "10.0.0.3", Heard(self, Tcp(cell, "10.0.0.3"))),  # type: ignore[arg-type]
            Plc(self, "rtu", Heard(self, Rtu(cell))),
            CanPlc(self, "node", Heard(self, Can(cell))),
            Ladder(self, "10.0.0.6", Heard(self, Tcp(cell, "10.0.0.6"))),
            GatewayPlc(self, "10.0.0.7", Heard(self, Tcp(cell, "10.0.0.7"))),
        ]

    def take(self, step: Step) -> None:
        """Take a step and check what must hold."""
        name, who, n = step
        self.cell.step += 1
        own = getattr(self, name, None)
        if own is not None:
            own(n)
        else:
            plc = self.plcs[who]
            getattr(plc, name, plc.repeat)(n)
        self.plcs[who].check()
        self.check()

    # What happens to the cell.

    def scan(self, n: int) -> None:
        """Let the cell scan."""
        self.cell.scan()
        run = self.cell.running
        assert run is None or self.cell.bridge.holder.startswith(self.owner_of(run).name), f"{run} without the lease"

    def finish(self, n: int) -> None:
        """End the run; who asked for it, and for nothing else since, reads how."""
        run = self.cell.running
        self.cell.end(ENDINGS[n % len(ENDINGS)])
        if run is not None:
            owner = self.owner_of(run)
            is_newest = type(owner) in (Plc, BlockPlc) and owner.program.number == run.command.sequence
            if is_newest and not owner.late and owner.program.asked[run.command.sequence][0] <= run.began:
                said = owner.read()
                assert said is not None
                assert said[0] == run.command.sequence, f"{owner.name}: {run} ended without a word"

    def pass_time(self, n: int) -> None:
        """Let time pass."""
        self.cell.wait((0.05, 0.3, 0.9, 2.5)[n % 4])

    def restart_cell(self, n: int) -> None:
        """Start the cell anew: everybody connects again, and the first PLC does not notice."""
        self.cell.runs.clear()
        self.cell.start()
        self.judged = 0
        self.connect(self.plcs[0].program)

    # Conditions.

    def owner_of(self, run: Run) -> Plc:
        """Return the client whose run it is."""
        source = run.command.source
        return next(plc for plc in self.plcs if source.startswith(plc.name))

    def run_of(self, plc: Plc, number: int) -> Run | None:
        """Return the run of a number since this program requested it."""
        since = plc.program.asked[number][0]
        return next(
            (
                run
                for run in reversed(self.cell.runs)
                if run.command.sequence == number and run.began >= since and self.owner_of(run) is plc
            ),
            None,
        )

    def last_of(self, plc: Plc) -> Run | None:
        """Return the last run of a client."""
        return next((run for run in reversed(self.cell.runs) if self.owner_of(run) is plc), None)

    def check(self) -> None:
        """Check every run that has begun since the last look."""
        for run in self.cell.runs[self.judged :]:
            plc, number = self.owner_of(run), run.command.sequence
            assert not self.stops, f"{plc.name}: {number} began while {self.stops} hold a stop"
            if isinstance(plc, Ladder):
                continue
            assert number in plc.program.asked, f"{plc.name}: {number} ran, which this program never sent"
            since = plc.program.asked[number][0]
            again = [each for each in self.cell.runs if each.command.sequence == number and each.began >= since]
            again = [each for each in again if self.owner_of(each) is plc]
            assert len(again) == 1, f"{plc.name}: {number} ran {len(again)} times"
            assert number not in plc.program.refused, f"{plc.name}: {number} ran after it was refused"
        self.judged = len(self.cell.runs)


class Heard:
    """A client whose bytes are kept for the report of a failure."""

    def __init__(self, line: Line, client: Client | Can) -> None:
        self._line, self._client = line, client

    def ask(self, request: bytes) -> bytes:
        """Send a request."""
        if request[0] not in (2, 4):
            self._line.sent.append(f"{self._line.cell.now:9.2f} s  {self._name}  {request.hex(' ')}")
        return self._client.ask(request)  # type: ignore[union-attr]

    def give(self, cob: int, data: bytes) -> None:
        """Send a frame."""
        self._line.sent.append(f"{self._line.cell.now:9.2f} s  {self._name}  {cob:03X}#{data.hex(' ')}")
        self._client.give(cob, data)  # type: ignore[union-attr]

    @property
    def _name(self) -> str:
        host = getattr(self._client, "host", type(self._client).__name__.lower())
        return f"{host:9}"

    def __getattr__(self, name: str) -> Any:
        return getattr(self._client, name)


WEIGHTS = {
    "order": 26,
    "repeat": 10,
    "empty": 4,
    "lose": 3,
    "come_late": 8,
    "ask_late": 3,
    "acknowledge": 8,
    "lease": 4,
    "stop_by_code": 2,
    "restart": 3,
    "freeze": 1,
    "reconnect": 2,
    "hold_stop": 1,
    "release_stop": 8,
    "tear": 2,
    "swap": 2,
    "forward": 5,
    "leave": 1,
    "scan": 12,
    "finish": 12,
    "pass_time": 1,
}
CLIENTS = 7
RESTARTS = 2000
"""One step in so many restarts the cell."""


def steps(seed: int, count: int) -> list[Step]:
    """Return a random walk."""
    rng = random.Random(seed)
    names = rng.choices(list(WEIGHTS), list(WEIGHTS.values()), k=count)
    walk = [(name, rng.randrange(CLIENTS), rng.randrange(0x10000)) for name in names]
    for place in range(RESTARTS, count, RESTARTS):
        walk[place] = ("restart_cell", 0, 0)
    return walk


def walk(taken: Iterable[Step]) -> tuple[int, str, Line]:
    """Take steps until one breaks what must hold; return how many were taken, what broke, and the line."""
    line, count = Line(), 0
    for count, step in enumerate(taken, 1):
        try:
            line.take(step)
        except AssertionError as error:
            return count, str(error).partition("\n")[0], line
    return count, "", line
