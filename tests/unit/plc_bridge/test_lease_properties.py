"""The lease as the table of docs/plc.md has it, written a second time and simply: both must agree whatever happens."""

from hypothesis import event, given, settings
from hypothesis import strategies as st

from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import Control, LeaseState, Refusal, Report, Result
from plc_bridge.protocol.registers import Lease

TIMEOUT, PROGRAM = 5.0, 100
PAGE = "page 10.0.0.3"
"""A user's link, whose orders have no numbers of their own."""
LINKS = ("10.0.0.1:49152", "Operator@10.0.0.2:40000", "rtu:ttyS0", "node 1", PAGE)
WORDS = "ask ask start start start write read release stop finish wait wait reconnect"
ACTIONS = st.tuples(st.sampled_from(WORDS.split()), st.sampled_from(LINKS), st.sampled_from([0.5, 4.9, TIMEOUT, 5.1]))


class Cell:
    """The handshake, and beside it a model of the holder of the lease."""

    def __init__(self) -> None:
        self.now, self.holder, self.running, self.is_given_back = 0.0, "", None, False
        self.handshake = Handshake({PROGRAM: "insert_peg"}, (), 1e9, TIMEOUT, now=lambda: self.now)
        self.heard = {}
        self.images = {}
        self.sources = {}
        self.connections = 0
        for host in LINKS:
            self.open(host)

    def open(self, host):
        self.connections += 1
        source = self.sources[host] = f"{host}#{self.connections}"
        self.handshake.opened(source, host)
        self.heard[source] = self.now
        self.images[host] = (int(host != PAGE), Lease.NONE)
        self.send(host)

    def is_open_to(self, host):
        """Return True if a host's connection may take the lease, also from its closed one, except during a run."""
        if self.holder in ("", self.sources[host]):
            return True
        return self.holder.partition("#")[0] == host and (not self.is_runner or self.is_given_back)

    @property
    def is_runner(self):
        """True if the holder's own run is under way: it keeps the lease to the end."""
        return self.running is not None and self.running.source == self.holder

    def send(self, host, code=0):
        """Write the block as it stands; its request for the lease stays until it is taken back."""
        (sequence, wish), source = self.images[host], self.sources[host]
        self.expire()
        self.heard[source] = self.now
        if host == PAGE and code:
            self.handshake.submit(source, CommandImage(code=code))
            return
        image = CommandImage(sequence=sequence, code=code, lease=wish)
        self.handshake.wrote(source, image, is_numbered=host != PAGE)
        if wish == Lease.TAKE and self.is_open_to(host):
            self.holder = source
        if source == self.holder and wish:
            self.is_given_back = wish == Lease.RELEASE and self.is_runner
        if wish == Lease.RELEASE and self.is_open_to(host) and not self.is_runner:
            self.holder = ""

    def expire(self):
        if self.holder and not self.is_runner and self.now - self.heard[self.holder] > TIMEOUT:
            self.holder = ""

    def ask(self, host, _):
        self.images[host] = (self.images[host][0], Lease.TAKE)
        self.send(host)

    def release(self, host, _):
        self.images[host] = (self.images[host][0], Lease.RELEASE)
        self.send(host)
        self.images[host] = (self.images[host][0], Lease.NONE)

    def write(self, host, _):
        self.send(host)

    def read(self, host, _):
        self.heard[self.sources[host]] = self.now
        self.handshake.heard(self.sources[host])
        self.poll()  # every scan lets the time-outs act

    def wait(self, _, seconds):
        self.now += seconds
        self.poll()

    def start(self, host, _):
        self.images[host] = (self.images[host][0] + 1, self.images[host][1])
        self.send(host, PROGRAM)
        answer = self.handshake.report_for(self.sources[host])
        if not self.is_open_to(host):
            assert answer.refusal is Refusal.NOT_HOLDER
            assert answer.holder == self.holder
        elif self.running is not None:
            assert answer.refusal is Refusal.BUSY
        else:
            assert self.handshake.inputs(self.sources[host]).busy
            self.holder = self.sources[host]
            self.poll()
            answer = self.handshake.report_for(self.sources[host])
            assert (answer.answered, answer.refusal) == (self.images[host][0], Refusal.NONE)
        self.poll()

    def stop(self, host, _):
        """Every link may stop; a stop gives no link the lease."""
        source = self.sources[host]
        self.expire()
        self.heard[source] = self.now
        self.handshake.switched(source, {"stop": True})
        command = self.handshake.poll()
        assert (command.code, command.source) == (Control.STOP, source)
        self.handshake.switched(source, {"stop": False})
        self.end(Result.ABORTED)

    def finish(self, _, __):
        self.end(Result.SUCCESS)

    def reconnect(self, host, _):
        """The new connection of the host gets the lease of the old one only by a request or a start."""
        self.expire()
        self.handshake.closed(self.sources[host])
        self.open(host)

    def end(self, result):
        if self.running is not None:
            self.handshake.publish(Report(sequence=self.running.sequence, result=result))
            self.holder = "" if self.is_given_back and self.is_runner else self.holder
            self.running, self.is_given_back = None, False

    def poll(self):
        self.expire()
        while (command := self.handshake.poll()) is not None:
            if command.code == PROGRAM:
                assert self.running is None
                assert command.source == self.holder, "somebody started who did not hold the lease"
                event(f"started by {command.source.partition(':')[0]}")
                self.running = command
                self.handshake.accept(command)
                self.handshake.publish(Report(sequence=command.sequence, state=6))

    def check(self):
        assert self.handshake.holder == self.holder
        for host, source in self.sources.items():
            expected = LeaseState.FREE if self.is_open_to(host) else LeaseState.TAKEN
            expected = LeaseState.YOURS if self.holder == source else expected
            assert self.handshake.report_for(source).lease is expected


@settings(max_examples=150)
@given(st.lists(ACTIONS, min_size=20, max_size=80))
def test_only_the_holder_by_the_table_starts(actions):
    cell = Cell()
    for action, link, seconds in actions:
        getattr(cell, action)(link, seconds)
        cell.check()
