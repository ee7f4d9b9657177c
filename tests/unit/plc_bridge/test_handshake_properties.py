"""Rough networks, rough clients, restarts of either side: what must hold whatever happens."""

from dataclasses import replace

from hypothesis import event, given, settings
from hypothesis import strategies as st

from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import FIRST_PROGRAM, Command, Control, Refusal, Report, Result
from plc_bridge.protocol.registers import Lease

PROGRAMS = {100: "insert_peg", 101: "grasp"}
CONTROLS = [control for control in Control if control < FIRST_PROGRAM]
LIFE_TIMEOUT, LEASE_TIMEOUT = 1.0, 5.0
STOPS = (Control.STOP, Control.ABORT, Control.LOST)

WEIGHTS = {
    "begin": 8,
    "ask": 4,
    "control": 1,
    "repeat": 3,
    "acknowledge": 1,
    "arrive": 6,
    "arrive_twice": 3,
    "arrive_again_late": 3,
    "lose": 1,
    "tear": 3,
    "deliver_all": 3,
    "reconnect": 1,
    "reconnect_half_open": 1,
    "lose_heartbeat": 1,
    "restart_plc": 1,
    "restart_cell": 1,
    "stop": 1,
    "stop_in_vain": 1,
    "pass_a_moment": 3,
    "pass_a_while": 1,
    "publish": 4,
    "scan": 8,
    "scan_and_refuse": 1,
    "finish": 5,
}
ACTIONS = st.tuples(
    st.sampled_from([name for name, weight in WEIGHTS.items() for _ in range(weight)]),
    st.sampled_from(["north", "north", "south"]),
    st.integers(0, 7),
)


class Plc:
    """One PLC: the block it wants the cell to have, and the writes on their way."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.connections = 0
        self.link = ""
        self.image = CommandImage()
        self.on_their_way: list[CommandImage] = []
        self.arrived: list[CommandImage] = []


class RoughLine:
    """Two PLCs and a supervisor; the serial number of every command identifies its intent."""

    def __init__(self) -> None:
        self.now = 0.0
        self.intents = self.runs = 0
        self.delivered: set[str] = set()
        self.stopped: set[str] = set()
        self.outcomes: dict[str, Result] = {}
        self.plcs = {name: Plc(name) for name in ("north", "south")}
        self.restart_cell(self.plcs["north"], 0)

    def send(self, plc, **changes):
        life = plc.image.life % 0xFFFF + 1
        plc.image = replace(plc.image, life=life, life_tail=life, **changes)
        plc.on_their_way.append(plc.image)

    def deliver(self, plc, image):
        self.handshake.wrote(plc.link, image, self.now)
        if image.life == image.life_tail:
            plc.arrived.append(image)

    def open(self, plc):
        plc.connections += 1
        plc.link = f"{plc.name}:{plc.connections}"
        plc.on_their_way.clear()
        plc.arrived.clear()
        self.handshake.opened(plc.link, plc.name, self.now)
        self.send(plc)

    def ask(self, plc, n, code=0):
        self.intents += 1
        lease = Lease.RELEASE if n == 7 else Lease.NONE
        sequence = (plc.image.sequence + 1) % 0x10000
        serial = f"intent {self.intents}"
        self.send(plc, sequence=sequence, code=code or 100 + n % 2, lease=lease, serial=serial)

    def begin(self, plc, n):
        """Go the straight way up to a run, but leave the write to be repeated by the network."""
        self.deliver_all(plc, n)
        self.ask(plc, n)
        self.arrive_twice(plc, n)
        self.scan(plc, n)

    def control(self, plc, n):
        self.ask(plc, n, CONTROLS[n % len(CONTROLS)])

    def repeat(self, plc, n):
        self.send(plc)

    def acknowledge(self, plc, n):
        self.send(plc, acknowledge=plc.image.sequence)

    def arrive(self, plc, n):
        """Deliver one of the writes on their way, usually the oldest; the others come later."""
        if plc.on_their_way:
            self.deliver(plc, plc.on_their_way.pop(max(n - 4, 0) % len(plc.on_their_way)))

    def arrive_twice(self, plc, n):
        if plc.on_their_way:
            self.deliver(plc, plc.on_their_way[0])

    def arrive_again_late(self, plc, n):
        if plc.arrived:
            self.deliver(plc, plc.arrived[-1 - n % len(plc.arrived)])

    def lose(self, plc, n):
        if plc.on_their_way:
            plc.on_their_way.pop()

    def tear(self, plc, n):
        """Deliver the first half of the oldest write: its head, but not its code, serial and tail."""
        if plc.on_their_way:
            whole = plc.on_their_way[0]
            self.deliver(plc, replace(whole, code=101, serial="torn", life_tail=(whole.life + 7) % 0xFFFF + 1))

    def deliver_all(self, plc, n):
        while plc.on_their_way:
            self.arrive(plc, 0)

    def reconnect(self, plc, n):
        self.handshake.closed(plc.link)
        self.open(plc)

    def reconnect_half_open(self, plc, n):
        self.open(plc)

    def lose_heartbeat(self, plc, n):
        self.handshake.lost(plc.link)

    def restart_plc(self, plc, n):
        self.handshake.closed(plc.link)
        plc.image = CommandImage(sequence=n)
        self.open(plc)

    def restart_cell(self, plc, n):
        self.handshake = Handshake(PROGRAMS, (), LIFE_TIMEOUT, LEASE_TIMEOUT)
        self.report = Report()
        self.running: Command | None = None
        for each in self.plcs.values():
            self.open(each)

    def stop(self, plc, n):
        self.stopped |= {image.serial for each in self.plcs.values() for image in each.arrived}
        self.handshake.switched(plc.link, {"stop": True}, self.now)
        self.handshake.switched(plc.link, {"stop": False}, self.now)
        self.scan(plc, n)
        assert self.running is None

    def stop_in_vain(self, plc, n):
        """The cell has nothing to stop and says so; nobody's own answer changes."""
        self.drain()
        if self.running is not None:
            return
        before = self.answers()
        self.handshake.switched(plc.link, {"stop": True}, self.now)
        self.handshake.switched(plc.link, {"stop": False}, self.now)
        self.handshake.orders.refuse(self.handshake.poll(self.now), Refusal.NOT_READY)
        assert self.answers() == before

    def answers(self):
        answers = [self.handshake.answer(plc.link) for plc in self.plcs.values()]
        return [(each.sequence, each.result, each.answered, each.refusal) for each in answers]

    def pass_a_moment(self, plc, n):
        self.now += 0.05

    def pass_a_while(self, plc, n):
        self.now += n

    def publish(self, plc, n):
        self.handshake.orders.publish(self.report)

    def scan(self, plc, n):
        command = self.handshake.poll(self.now)
        if command is not None:
            self.act(command)
        self.handshake.orders.publish(self.report)

    def scan_and_refuse(self, plc, n):
        """The cell itself may be unable to do what the handshake has accepted."""
        command = self.handshake.poll(self.now)
        if command is not None and (command.code in PROGRAMS or command.code in CONTROLS) and command.code not in STOPS:
            before = self.handshake.counts.refusals
            self.handshake.orders.refuse(command, Refusal.NOT_READY)
            assert self.handshake.counts.refusals == before + 1
        elif command is not None:
            self.act(command)
        self.handshake.orders.publish(self.report)

    def finish(self, plc, n):
        if self.running is not None:
            self.end((Result.SUCCESS, Result.FAILURE, Result.FAULT)[n % 3])

    def act(self, command):
        if command.code in PROGRAMS:
            assert self.running is None, "two programs at once"
            assert command.serial != "torn", "a torn block ran"
            assert command.serial not in self.stopped, "a command ran that was stopped before"
            assert command.serial not in self.delivered, "the same command ran twice"
            self.runs += 1
            self.delivered.add(command.serial)
            self.running = command
            self.handshake.orders.accept(command)
            self.report = Report(sequence=command.sequence, state=6)
        elif self.running is not None and command.code in STOPS:
            self.handshake.orders.accept(command)
            self.end(Result.ABORTED)
        elif self.running is None and command.code < FIRST_PROGRAM:
            self.handshake.orders.accept(command)
            self.report = Report(sequence=command.sequence, result=Result.SUCCESS)

    def end(self, result):
        self.outcomes[self.running.serial] = result
        self.report = Report(sequence=self.running.sequence, result=result)
        self.running = None
        self.handshake.orders.publish(self.report)

    def check(self):
        """A result under a PLC's number must be the result of the command that it wrote on this connection."""
        assert self.running is None or self.handshake.orders.run is not None
        for plc in self.plcs.values():
            answer, image = self.handshake.answer(plc.link), plc.image
            is_asked = image.code in PROGRAMS and image.serial in {each.serial for each in plc.arrived}
            if not is_asked or answer.sequence != image.sequence or answer.result is Result.NONE:
                continue
            if answer.result is Result.REFUSED or image.serial not in self.delivered:
                assert answer.result in (Result.REFUSED, Result.ABORTED)
            else:
                event("read its result")
                assert self.outcomes[image.serial] is answer.result

    def settle(self):
        """When the line is quiet again, the next command runs, is answered, and leaves the line ready."""
        self.now += LEASE_TIMEOUT + 1.0
        self.drain()
        if self.running is not None:
            self.end(Result.SUCCESS)
        self.handshake.opened("fresh", "elsewhere", self.now)
        for sequence, code, acknowledge in ((40, 0, 0), (41, 100, 0)):
            image = CommandImage(sequence=sequence, code=code, serial="last", acknowledge=acknowledge)
            self.handshake.wrote("fresh", image, self.now)
        self.drain()
        self.end(Result.FAILURE)
        assert self.handshake.answer("fresh").result is Result.FAILURE
        self.handshake.wrote("fresh", replace(image, acknowledge=41), self.now)
        assert self.handshake.answer("fresh").result is Result.NONE
        assert not self.handshake.inputs("fresh").busy

    def drain(self):
        while (command := self.handshake.poll(self.now)) is not None:
            self.act(command)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(st.lists(ACTIONS, min_size=30, max_size=90))
def test_never_twice_never_anothers_result_always_ready_again(actions):
    line = RoughLine()
    for action, name, n in actions:
        getattr(line, action)(line.plcs[name], n)
        line.check()
    event(f"{min(line.runs, 5)} runs or more")
    line.settle()
