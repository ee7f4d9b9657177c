"""The lease as the README's table has it, written a second time and simply: both must agree whatever happens."""

from hypothesis import event, given, settings
from hypothesis import strategies as st

from plc_bridge.handshake import Handshake
from plc_bridge.images import CommandImage
from plc_bridge.messages import Control, LeaseState, Refusal, Report, Result
from plc_bridge.registers import Lease

TIMEOUT, PROGRAM = 5.0, 100
LINKS = ("10.0.0.1:49152", "Operator@10.0.0.2:40000", "rtu:ttyS0", "node 1")
TERMINAL = "terminal"
ACTIONS = st.tuples(
    st.sampled_from(
        [
            "ask",
            "ask",
            "start",
            "start",
            "start",
            "write",
            "read",
            "release",
            "stop",
            "finish",
            "wait",
            "wait",
            "terminal_takes",
            "terminal_starts",
            "terminal_releases",
            "reconnect",
        ]
    ),
    st.sampled_from(LINKS),
    st.sampled_from([0.5, 4.9, 5.1]),
)


class Cell:
    """The handshake, and beside it who should hold the lease."""

    def __init__(self) -> None:
        self.now, self.holder, self.running = 0.0, "", None
        self.handshake = Handshake({PROGRAM: "insert_peg"}, (), life_timeout=1e9, lease_timeout=TIMEOUT)
        self.heard = {}
        self.images = {}
        self.is_at_terminal = False
        for link in LINKS:
            self.open(link)

    def open(self, link):
        self.handshake.opened(link, link, self.now)
        self.heard[link] = self.now
        self.images[link] = (1, Lease.NONE)
        self.send(link)

    def send(self, link, code=0):
        """Write the block as it stands; a wish for the lease stands in it until it is taken back."""
        sequence, wish = self.images[link]
        self.expire()
        self.heard[link] = self.now
        self.handshake.wrote(link, CommandImage(sequence=sequence, code=code, lease=wish), self.now)
        if wish == Lease.TAKE and not self.holder:
            self.holder = link
        if wish == Lease.RELEASE and self.holder == link:
            self.holder = ""

    def expire(self):
        if self.holder not in ("", TERMINAL) and self.now - self.heard[self.holder] > TIMEOUT:
            self.holder = ""

    def ask(self, link, _):
        self.images[link] = (self.images[link][0], Lease.TAKE)
        self.send(link)

    def release(self, link, _):
        self.images[link] = (self.images[link][0], Lease.RELEASE)
        self.send(link)
        self.images[link] = (self.images[link][0], Lease.NONE)

    def write(self, link, _):
        self.send(link)

    def read(self, link, _):
        self.heard[link] = self.now
        self.handshake.heard(link, self.now)
        self.handshake.poll(self.now)  # every scan lets the time-outs act

    def wait(self, _, seconds):
        self.now += seconds
        self.poll()

    def start(self, link, _):
        self.images[link] = (self.images[link][0] + 1, self.images[link][1])
        self.send(link, PROGRAM)
        answer = self.handshake.answer(link)
        if self.holder not in ("", link):
            assert answer.refusal is Refusal.NOT_HOLDER
            assert answer.report.holder == self.holder
        elif self.running is not None:
            assert answer.refusal is Refusal.BUSY
        else:
            assert answer.refusal is Refusal.NONE
            self.holder = link
        self.poll()

    def stop(self, link, _):
        """Anybody may, and it gives nobody the lease."""
        self.expire()
        self.heard[link] = self.now
        self.handshake.switched(link, {"stop": True}, self.now)
        command = self.handshake.poll(self.now)
        assert (command.code, command.source) == (Control.STOP, link)
        self.end(Result.ABORTED)

    def finish(self, _, __):
        self.end(Result.SUCCESS)

    def reconnect(self, link, _):
        """The new link of the same host goes on with what the old one held."""
        self.expire()
        self.handshake.closed(link)
        self.open(link)

    def terminal_takes(self, _, __):
        if not self.is_at_terminal:
            self.handshake.opened(TERMINAL, TERMINAL, self.now, is_local=True)
            self.is_at_terminal = self.handshake.take(TERMINAL)
            assert self.is_at_terminal == (not self.holder)
            self.holder = self.holder or TERMINAL

    def terminal_starts(self, _, __):
        if self.is_at_terminal:
            refusal = self.handshake.submit(TERMINAL, CommandImage(code=PROGRAM), self.now)
            assert (refusal is Refusal.NONE) == (self.running is None)
            self.poll()

    def terminal_releases(self, _, __):
        if self.is_at_terminal:
            self.handshake.release(TERMINAL)
            self.is_at_terminal, self.holder = False, ""

    def end(self, result):
        if self.running is not None:
            self.handshake.publish(Report(sequence=self.running.sequence, result=result))
            self.running = None

    def poll(self):
        self.expire()
        while (command := self.handshake.poll(self.now)) is not None:
            if command.code == PROGRAM:
                assert self.running is None
                assert command.source == self.holder, "somebody started who did not hold the lease"
                event(f"started by {command.source.partition(':')[0]}")
                self.running = command
                self.handshake.publish(Report(sequence=command.sequence, state=6))

    def check(self):
        assert self.handshake.holder == self.holder
        for link in LINKS:
            expected = LeaseState.FREE if not self.holder else LeaseState.TAKEN
            assert self.handshake.answer(link).lease is (LeaseState.YOURS if self.holder == link else expected)


@settings(max_examples=150, deadline=None, derandomize=True, database=None)
@given(st.lists(ACTIONS, min_size=20, max_size=80))
def test_only_the_holder_starts_and_the_holder_is_who_the_table_says(actions):
    cell = Cell()
    for action, link, seconds in actions:
        getattr(cell, action)(link, seconds)
        cell.check()
