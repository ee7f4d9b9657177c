"""The sequence-number handshake: pure, no sockets, no threads, time passed in.

A *link* is one conversation with one sequence number: a TCP connection, or all connections of a host that asked for
that, or a serial line, or a local user. Links come and go; what may run is decided here, once for all buses.

Sequence numbers
    | seen on a link                                | what happens                                                  |
    | --------------------------------------------- | ------------------------------------------------------------- |
    | the first one after it opened or was lost     | adopted, never run; refused ADOPTED if it came with a command |
    | the same again, whatever else the block holds | nothing                                                       |
    | one of the last `LATE_WINDOW` before it       | refused LATE                                                  |
    | any other                                     | a command, which counts once and is answered at once          |

Answers
    Every number gets one: `answered` with `refusal`. `sequence` and `result` tell how the link's own last command
    ended and are held until it is acknowledged or the next command comes; another's run never shows in them. A link
    that never wrote sees the run of whoever runs.
"""

import logging
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from plc_bridge.images import CommandImage
from plc_bridge.lease import CellLease
from plc_bridge.links import Link
from plc_bridge.messages import (
    FIRST_PROGRAM,
    UNNUMBERED,
    Command,
    Control,
    LeaseState,
    Refusal,
    Report,
    Result,
    Transition,
)
from plc_bridge.registers import VERSION_MAJOR, Lease, Parameter
from plc_bridge.watchdog import Watchdog

logger = logging.getLogger(__name__)

LATE_WINDOW = 256
"""How far behind a sequence number is taken for an old write; further behind the PLC's counter has restarted."""
MOST_PENDING = 8
"""Controls that may wait for the scan thread."""

_STOPS = (Control.STOP, Control.ABORT)
_CONTROLS = frozenset(control.value for control in Control if control < FIRST_PROGRAM)


@dataclass(frozen=True, slots=True)
class Answer:
    """What the report tells one link about its own command."""

    sequence: int
    result: Result
    answered: int
    refusal: Refusal
    code: int
    is_busy: bool
    lease: LeaseState
    report: Report
    """The cell as published last; details of an older run than `sequence` are blanked."""


@dataclass(slots=True)
class Counts:
    """What went wrong since the start."""

    refusals: int = 0
    torn: int = 0
    lost: int = 0


@dataclass(slots=True)
class _Current:
    """The command that the scan thread works on or has finished last."""

    command: Command
    link: Link
    is_delivered: bool = False
    is_taken_up: bool = False
    is_lost: bool = False
    result: Result = Result.NONE
    is_acknowledged: bool = False

    @property
    def is_busy(self) -> bool:
        return self.command.code >= FIRST_PROGRAM and self.result is Result.NONE

    @property
    def is_watched(self) -> bool:
        return self.is_busy and not self.is_lost and not self.link.is_local


@dataclass(slots=True)
class Handshake:
    """Commands in from any number of links, at most one run at a time out, the right answer back to each.

    Args:
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: What the numbered parameters mean.
        life_timeout: A run is lost when the life counter of its link stands still for this long, s. A link that
            never wrote its life counter shows life with any request.
        lease_timeout: Silence after which the lease is free again, s.
    """

    programs: Mapping[int, str]
    parameters: Sequence[Parameter] = ()
    life_timeout: float = 1.0
    lease_timeout: float = 5.0
    counts: Counts = field(default_factory=Counts)
    _links: dict[str, Link] = field(default_factory=dict)
    _current: _Current | None = None
    _stops: dict[int, Command] = field(default_factory=dict)
    _controls: deque[Command] = field(default_factory=deque)
    _report: Report = field(default_factory=Report)
    _last: tuple[int, Refusal] = (0, Refusal.NONE)
    _lease: CellLease = field(init=False)

    def __post_init__(self) -> None:
        self._lease = CellLease(self.lease_timeout)

    def opened(self, source: str, host: str, now: float, is_local: bool = False) -> None:
        """Begin a link; a local one is never silent."""
        self._links[source] = Link(source, host, Watchdog(now), is_local)

    def closed(self, source: str) -> None:
        """End a link; what it holds and runs stays until its host comes back or the time-outs pass."""
        link = self._links.pop(source, None)
        if link is not None:
            link.is_open = False

    def lost(self, source: str) -> None:
        """Take `source` for lost, whatever its life counter says: what it runs stops, its next number is adopted."""
        link, current = self._links[source], self._current
        link.must_adopt = True
        link.execute = link.reset = None
        self._lease.release(source)
        if current is not None and current.link is link and current.is_watched:
            self._lose(current, "its bus says so")

    def heard(self, source: str, now: float) -> None:
        """Note that any request came from `source`."""
        self._links[source].watchdog.heard = now

    def wrote(self, source: str, image: CommandImage, now: float, is_numbered: bool = True) -> None:
        """Take the command block as it stands after a write of `source`; it counts once its number was written."""
        self._expire(now)
        link = self._links[source]
        self._speak(link)
        before, link.image = link.image, image
        if not link.watchdog.see(image.life, image.life_tail, now):
            self.counts.torn += 1
            return
        self._update_lease(link, image.lease)
        if image.acknowledge != (before.acknowledge if before else 0):
            self._acknowledge(link, image.acknowledge)
        if is_numbered:
            self._take_sequence(link, image, now)

    def switched(self, source: str, coils: Mapping[str, bool], now: float) -> None:
        """Take the coils that `source` has just written: execute, stop, reset."""
        self._expire(now)
        link = self._links[source]
        link.watchdog.heard = now
        if coils.get("stop"):
            self._stop(Command(UNNUMBERED, Control.STOP, source=source))
        image = link.image or CommandImage()
        if "execute" in coils:
            self._speak(link)
            is_rising, link.execute = coils["execute"] and link.execute is False, coils["execute"]
            if is_rising:
                self._command(link, self._count_up(link), image, now)
            elif not coils["execute"]:
                self._acknowledge(link, self.answer(source).sequence)
        if "reset" in coils:
            self._speak(link)
            is_rising, link.reset = coils["reset"] and link.reset is False, coils["reset"]
            if is_rising:
                self._command(link, self._count_up(link), replace(image, code=Control.RESET), now)

    def take(self, source: str) -> bool:
        """Give `source` the lease if it is free; return whether it holds it now."""
        return self._lease.take(self._links[source])

    def release(self, source: str) -> None:
        """Free the lease if `source` holds it."""
        self._lease.release(source)

    def submit(self, source: str, image: CommandImage, now: float) -> Refusal:
        """Run what a local user asks for as the next number of `source`; return why it was refused."""
        self._expire(now)
        link = self._links[source]
        self._speak(link)
        link.image = image
        self._command(link, self._count_up(link), image, now)
        return link.refusal

    def poll(self, now: float) -> Command | None:
        """Return the next thing for the scan thread to do, stops first, each once."""
        self._expire(now)
        if self._stops:
            return self._stops.pop(max(self._stops))
        current = self._current
        if self._controls:
            return self._controls.popleft()
        if current is not None and not current.is_delivered and current.result is Result.NONE:
            current.is_delivered = True
            return current.command
        return None

    def publish(self, report: Report) -> None:
        """Take the scan thread's report; its result ends the delivered command whose number it echoes."""
        self._report = report
        current = self._current
        if current is None or not current.is_delivered or report.sequence != current.command.sequence:
            return
        current.is_taken_up = True
        if current.result is Result.NONE and report.result is not Result.NONE:
            current.result = report.result

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Take back that `command`, which the scan thread was given, was accepted."""
        current, link = self._current, self._links.get(command.source)
        if current is not None and current.command is command:
            current.result, link = Result.REFUSED, current.link
        elif link is not None and link.own is not None and link.own[0] == command.sequence:
            link.own = (*link.own[:2], Result.REFUSED)
        if link is not None and link.answered == command.sequence:
            self._refuse(link, command.sequence, refusal)
        else:
            self.counts.refusals += 1
            what = "stop" if command.sequence == UNNUMBERED else f"command {command.sequence}"
            logger.warning("%s: %s refused: %s", command.source, what, refusal.name)

    @property
    def holder(self) -> str:
        """Who holds the lease; empty when it is free."""
        return self._lease.holder.source if self._lease.holder is not None else ""

    @property
    def transition(self) -> Transition | None:
        """Why the cell's state last changed."""
        return self._report.transition

    @property
    def is_busy(self) -> bool:
        """A program or skill is accepted and has not ended."""
        return self._current is not None and self._current.is_busy

    def answer(self, source: str) -> Answer:
        """Return what `source` shall read."""
        link, current = self._links[source], self._current
        answered, refusal = (link.answered, link.refusal) if link.has_spoken else self._last
        lease = self._lease.state_for(link)
        report = replace(self._report, holder=self.holder)
        if current is not None and not current.is_taken_up:
            report = Report(state=report.state, fault=report.fault, holder=report.holder, transition=report.transition)
        if link.own is not None:
            sequence, code, result = link.own
            return Answer(sequence, result, answered, refusal, code, False, lease, report)
        if current is None:
            return Answer(0, Result.NONE, answered, refusal, 0, False, lease, report)
        result = Result.NONE if current.is_acknowledged else current.result
        command = current.command
        return Answer(command.sequence, result, answered, refusal, command.code, current.is_busy, lease, report)

    def _take_sequence(self, link: Link, image: CommandImage, now: float) -> None:
        last = link.sequence
        if last is not None and image.sequence != last and (last - image.sequence) % 0x10000 <= LATE_WINDOW:
            self._refuse(link, image.sequence, Refusal.LATE)
            return
        link.sequence = image.sequence
        if link.must_adopt:
            link.must_adopt = False
            self._adopt(link, image)
        elif image.sequence != last:
            self._command(link, image.sequence, image, now)

    def _adopt(self, link: Link, image: CommandImage) -> None:
        if image.code in _STOPS:
            self._command_stop(link, image.sequence, image.code)
        elif self._is_current(link, image):
            self._accept(link, image.sequence)
        elif image.code == Control.NONE:
            self._accept(link, image.sequence)
            if link.own is not None:
                link.own = (image.sequence, image.code, Result.NONE)
        else:
            self._refuse(link, image.sequence, Refusal.ADOPTED)
            link.own = (image.sequence, image.code, Result.REFUSED)

    def _is_current(self, link: Link, image: CommandImage) -> bool:
        current = self._current
        if current is None or current.link is not link:
            return False
        command = current.command
        asked = (command.sequence, command.code, command.recipe, command.serial)
        return asked == (image.sequence, image.code, image.recipe, image.serial)

    def _command(self, link: Link, sequence: int, image: CommandImage, now: float) -> None:
        """Answer a number that counts."""
        if image.code in _STOPS:
            self._command_stop(link, sequence, image.code)
            return
        if image.code == Control.NONE:
            self._accept(link, sequence)
            if not self._keeps_following(link, sequence):
                link.own = (sequence, image.code, Result.NONE)
            return
        parameters = self._parameters(image)
        refusal = self._why_not(link, image)
        if refusal is Refusal.NONE and parameters is None:
            refusal = Refusal.PARAMETER
        if refusal is not Refusal.NONE or parameters is None:
            self._refuse(link, sequence, refusal)
            if not self._keeps_following(link, sequence):
                link.own = (sequence, image.code, Result.REFUSED)
            return
        self._lease.take(link)
        self._accept(link, sequence)
        command = Command(sequence, image.code, image.recipe, image.serial, parameters, link.source)
        if self.is_busy:
            self._controls.append(command)
            if not self._keeps_following(link, sequence):
                link.own = (sequence, image.code, Result.SUCCESS)
            return
        self._make_current(_Current(command, link))
        link.watchdog.revive(now)

    def _why_not(self, link: Link, image: CommandImage) -> Refusal:
        is_control = image.code in _CONTROLS
        if image.version and image.version >> 8 != VERSION_MAJOR:
            return Refusal.VERSION
        if not is_control and image.code not in self.programs:
            return Refusal.UNKNOWN_CODE
        if not self._lease.is_open_to(link):
            return Refusal.NOT_HOLDER
        if self.is_busy and (not is_control or len(self._controls) >= MOST_PENDING):
            return Refusal.BUSY
        return Refusal.NONE

    def _parameters(self, image: CommandImage) -> tuple[tuple[str, float], ...] | None:
        """Return the parameters in their units, or None where one is unknown or beyond its limits."""
        if not image.serial.isascii() or not image.serial.isprintable():
            return None
        values = []
        for number, count in image.parameters:
            if number >= len(self.parameters):
                return None
            spec = self.parameters[number]
            value = count * spec.scale
            slack = spec.scale / 2  # limits need not be a multiple of the scale
            if not spec.low - slack <= value <= spec.high + slack:
                return None
            values.append((spec.name, min(max(value, spec.low), spec.high)))
        return tuple(values)

    def _make_current(self, current: _Current) -> None:
        """Let every link that followed the command before keep what it was told."""
        old = self._current
        if old is not None and not old.is_delivered and old.result is Result.NONE:
            self._controls.append(old.command)
        for link in self._links.values():
            if old is not None and link.own is None and link.has_spoken and link is not current.link:
                result = Result.NONE if old.is_acknowledged else old.result
                link.own = (old.command.sequence, old.command.code, result)
        current.link.own = None
        self._current = current

    def _keeps_following(self, link: Link, sequence: int) -> bool:
        """Tell whether `link` waits for its run, and `sequence` is another number than that run's.

        A PLC whose counter restarted may send a run's number again for something else.
        """
        current = self._current
        return (
            current is not None
            and current.is_busy
            and current.link is link
            and link.own is None
            and current.command.sequence != sequence
        )

    def _command_stop(self, link: Link, sequence: int, code: int) -> None:
        self._accept(link, sequence)
        is_following = self._keeps_following(link, sequence)
        self._stop(Command(sequence, code, source=link.source))
        if not is_following:
            link.own = (sequence, code, Result.SUCCESS)

    def _stop(self, command: Command) -> None:
        """Queue a stop; what has not reached the scan thread yet never will."""
        self._stops[command.code] = command
        self._controls.clear()
        current = self._current
        if current is not None and not current.is_delivered and current.result is Result.NONE:
            current.result = Result.ABORTED

    def _acknowledge(self, link: Link, sequence: int) -> None:
        current = self._current
        if link.own is not None:
            if link.own[0] == sequence:
                link.own = (*link.own[:2], Result.NONE)
            return
        if current is None or current.link is not link or current.command.sequence != sequence:
            return
        if current.result is not Result.NONE and not current.is_acknowledged:
            current.is_acknowledged = True
            if len(self._controls) < MOST_PENDING:
                self._controls.append(Command(sequence, Control.ACKNOWLEDGE, source=link.source))

    def _update_lease(self, link: Link, wish: int) -> None:
        if wish in (Lease.TAKE, Lease.TAKE_FOR_HOST):
            self._lease.take(link)
        elif wish == Lease.RELEASE:
            self._lease.release(link.source)

    def _speak(self, link: Link) -> None:
        """Hand over what a closed link of the same host held, and make a spectator a client of its own."""
        self._lease.hand_over(link)
        current = self._current
        if current is not None and not current.link.is_open and current.link.host == link.host:
            if current.is_busy:
                link.watchdog.follow(current.link.watchdog)
            current.link, link.own = link, None
        elif not link.has_spoken:
            link.own = (0, Control.NONE, Result.NONE)
        link.has_spoken = True

    def _count_up(self, link: Link) -> int:
        link.sequence = ((link.sequence or 0) + 1) % 0x10000
        return link.sequence

    def _accept(self, link: Link, sequence: int) -> None:
        link.answered, link.refusal = self._last = sequence, Refusal.NONE

    def _refuse(self, link: Link, sequence: int, refusal: Refusal) -> None:
        if link.refusal is not refusal:
            logger.warning("%s: command %d refused: %s", link.source, sequence, refusal.name)
        self.counts.refusals += 1
        link.answered, link.refusal = self._last = sequence, refusal

    def _expire(self, now: float) -> None:
        """Let time-outs act: lost runs, silent holders, blocks that stay torn."""
        current = self._current
        if current is not None and current.is_watched and current.link.watchdog.is_silent(now, self.life_timeout):
            self._lose(current, f"no sign of life for {self.life_timeout:g} s")
        self._lease.expire(now)
        for link in self._links.values():
            if link.watchdog.is_torn(now, self.life_timeout):
                link.watchdog.torn_since = None
                if link.image is not None and link.image.sequence != link.sequence and not link.must_adopt:
                    link.sequence = link.image.sequence
                    self._refuse(link, link.sequence, Refusal.TORN)
                    if not self._keeps_following(link, link.sequence):
                        link.own = (link.sequence, link.image.code, Result.REFUSED)

    def _lose(self, current: _Current, why: str) -> None:
        logger.warning("%s is lost: %s", current.link.source, why)
        self.counts.lost += 1
        current.is_lost = True
        current.link.must_adopt = True
        current.link.execute = current.link.reset = None
        self._lease.release(current.link.source)
        self._stop(Command(current.command.sequence, Control.LOST, source=current.link.source))
