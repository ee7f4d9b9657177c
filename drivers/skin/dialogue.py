"""The dialogue of host and CySkin hub: discovery, start, and the joining of scans; pure, no I/O and no waiting."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.quantities import FINGERS, Vector
from drivers.skin.board_config import BOARD_MODULES, TEMPERATURE, HubConfig
from drivers.skin.cyskin_wire import (
    ALL_MODULES,
    LEAVE_BOOT_LOADER,
    Channels,
    HubCommand,
    Message,
    Module,
    ScanAssembler,
    Step,
    WireError,
    decode,
    decode_module,
    encode_period,
)
from drivers.skin.health import Counts
from drivers.transport.wires import CanFrame

RETRY = 0.1
"""Time between two attempts, s; the makers' host program waits as long for a hub that leaves its boot loader."""
TRIES = 3
"""Number of attempts to get an answer."""
_WAITS: dict[Step, float] = {
    "leave_modules_boot_loaders": 0.5,
    # Longest wait for an answer, s; the makers' host program waits 1.5 s.
    **dict.fromkeys(("discover", "declare", "details"), 0.5),
}
"""Longest time from a step to the next one, s. Source for the modules' boot loaders: the makers' host program [cyskin]."""
WATCHED_SCANS = 10


@dataclass(frozen=True, slots=True, eq=False)
class RawScan:
    """One scan of both fingers, as measured by the board."""

    counts: Counts
    """Readings, counts, shape (2, n), left finger first; 0 if the board has no channel for a taxel."""
    temperature: Vector
    """Raw temperature reading of each module, shape (4,), counts; NaN if a module has no such channel."""
    stamp: float
    """Arrival time of the first part, s."""
    missed: int
    """Number of scans lost directly before this one."""


class TaxelPlaces:
    """Places of the taxels of both fingers among the channels of a hub."""

    def __init__(self, uids: Sequence[int], config: HubConfig) -> None:
        """Find the taxels of `config` among channels with these numbers (uid), in the order of their readings."""
        wanted = config.modules or tuple(dict.fromkeys(uid >> 4 for uid in uids))[:BOARD_MODULES]
        at = {uid: index for index, uid in enumerate(uids)}
        # The array has one place more than the hub has channels; absent modules read that place.
        nowhere = len(uids)
        names = (*config.channels, TEMPERATURE)
        place = np.full((BOARD_MODULES, len(names)), nowhere)
        for row, sui in enumerate(wanted):
            place[row] = [at.get(sui << 4 | name, nowhere) for name in names]
        self._taxels = place[:, :-1].reshape(FINGERS, -1)
        self._temperatures = place[:, -1]

    def scan(self, counts: Counts, stamp: float, missed: int) -> RawScan:
        """Return the scan with these readings of all channels, counts."""
        temperature = np.append(counts.astype(float), np.nan)[self._temperatures]
        return RawScan(np.append(counts, np.uint16(0))[self._taxels], temperature, stamp, missed)


class CySkinDialogue:
    """Brings a hub from power-on to sensor data, and joins its scans; its port on each wire moves the bytes.

    Args:
        config: Config of the hub.
        period: Requested time between two scans, s.
    """

    def __init__(self, config: HubConfig, period: float) -> None:
        self._config, self._period = config, period
        self._uids: set[bytes] = set()
        self.modules: dict[int, Module] = {}
        """Modules on the hub, by their number on it."""
        self.forget()

    def forget(self) -> None:
        """Discard everything learnt about the board."""
        self.heard = self._wrong = self._unfit = self._incomplete = 0
        """Numbers of messages: decoded, with a wrong check sum, not valid now; number of scans with missing parts."""
        self.changed = ""
        """Text that names the modules exchanged since the first discovery; empty if none."""
        self._first_seen: tuple[int, ...] | None = None
        self.restart()

    def restart(self) -> None:
        """Restart the start-up, because the board may have lost power or may never have been connected."""
        self._step = self._tries = 0
        self.is_started = False
        """True from the first scan until the next restart."""
        self._next = -math.inf
        self._error = ""
        self._stamps: deque[float] = deque(maxlen=WATCHED_SCANS)
        self._forget_structure()

    def _forget_structure(self) -> None:
        self._uids.clear()
        self.modules.clear()
        self._count: int | None = None
        self._channels: Channels | None = None
        self._scans: ScanAssembler | None = None

    def ask(self, now: float) -> list[Message | CanFrame]:
        """Return the messages of the step that is due, and the frame that leaves the boot loader, until scans arrive.

        If a step gets no answer, it is repeated, then skipped, as in the makers' host program. If the discovery gets no answer,
        or no scans arrive at the end, the start-up begins again.
        """
        if self.is_started or now < self._next:
            return []
        steps = self._config.wire.start_up
        if self._tries:
            is_answered = self._is_answered(steps[self._step])
            if steps[self._step] == "discover" and not is_answered:
                self._step = self._tries = 0
            elif is_answered or self._tries == TRIES:
                self._step, self._tries = (self._step + 1) % len(steps), 0
        self._tries += 1
        self._next = now + _WAITS.get(steps[self._step], RETRY)
        return self._messages(steps[self._step])

    def take(self, data: bytes, stamp: float) -> list[RawScan]:
        """Take a message of the hub; return the scan that it completes, if any.

        Args:
            data: Bytes of the message.
            stamp: Time of arrival, s.
        """
        try:
            message = decode(data, self._config.wire)
        except WireError:
            self._wrong += 1
            return []
        try:
            scan = self._take(message, stamp)
        except WireError as error:
            self._unfit += 1
            self._error = f"; {error}"
            return []
        self.heard += 1
        return [] if scan is None else [scan]

    def refused(self) -> int:
        """Return the number of messages that could not be decoded."""
        return self._wrong + self._unfit

    def trouble(self) -> str:
        """Return the reason why no scan arrives, in one line: wrong check sums, or the next missing answer of the hub."""
        if self._wrong > self.heard:
            return f"{self._wrong} of {self._wrong + self.heard} messages have a wrong check sum: see board.wire.crc"
        hub = f"hub {self._config.wire.hub}"
        parts = f"; of {self._incomplete} scans only parts came" if self._incomplete else ""
        return f"{hub} {self._missing()}{parts}{self._error}"

    def _missing(self) -> str:
        if not self._uids:
            return "does not answer"
        if len(self._uids) > 1:
            return f"is one of {len(self._uids)} on the bus, uid {', '.join(sorted(u.hex() for u in self._uids))}: one allowed"
        if self._count is None:
            return "does not report its number of modules"
        if len(self.modules) != self._count:
            return f"reports {len(self.modules)} of its {self._count} modules"
        if self._channels is None:
            return "has modules that have not left their boot loaders: check their plugs"
        return f"has {len(self.modules)} modules and sends no whole scan"

    def _is_answered(self, step: Step) -> bool:
        if step == "discover":
            return len(self._uids) == 1
        if step == "declare":
            return self._count is not None
        if step == "details":
            return len(self.modules) == self._count
        return step != "start"

    def _messages(self, step: Step) -> list[Message | CanFrame]:
        wire = self._config.wire
        if step == "discover":
            self._forget_structure()
        elif step == "start" and self._channels is None:
            self._tries = TRIES  # without modules there is nothing to start
            return []
        elif step == "start":
            # Longest time from the start of a board to its first scan, multiple of the period.
            self._next += 3.0 * self._period
        messages: dict[Step, list[Message | CanFrame]] = {
            "leave_boot_loader": [LEAVE_BOOT_LOADER],
            "discover": [Message(HubCommand.DISCOVER)],
            "set_number": [Message(HubCommand.SET_NUMBER, uid + bytes([wire.hub])) for uid in self._uids],
            "declare": [Message(HubCommand.DECLARE)],
            "details": [Message(HubCommand.DETAILS, bytes([ALL_MODULES]))],
            "stop": [Message(HubCommand.AUTO_SYNC, b"\0")],
            "leave_modules_boot_loaders": [Message(HubCommand.LEAVE_MODULES_BOOT_LOADERS)],
            "start": [
                Message(HubCommand.PERIOD, encode_period(self._period, wire)),
                Message(HubCommand.AUTO_SYNC, b"\1"),
            ],
        }
        return messages[step]

    def _take(self, message: Message, stamp: float) -> RawScan | None:
        payload = message.payload
        if message.command == HubCommand.SENSOR_DATA:
            return self._add(message, stamp)
        # Length of the unique number of a hub, bytes.
        if message.command == HubCommand.DISCOVER and len(payload) == 4:
            self._uids.add(payload)
            self._next = min(self._next, stamp + RETRY)  # further hubs answer within this time
        elif message.command == HubCommand.DECLARE and self._count is None:
            self._take_count(payload)
        elif message.command == HubCommand.DETAILS and self._channels is None:
            self._take_module(decode_module(payload, self._config.wire))
        elif message.command == HubCommand.ERROR and len(payload) == 2:
            self._error = f"; the hub answers command 0x{payload[0]:02X} with error 0x{payload[1]:02X}"
        return None

    def _take_count(self, payload: bytes) -> None:
        if not payload or payload[0] == 0:
            raise WireError("a hub without modules")
        self._count, self._next = payload[0], -math.inf

    def _take_module(self, module: Module) -> None:
        """Take the details of a module; the last one completes the channels, if all modules have left their boot loaders."""
        self.modules[module.number] = module
        if len(self.modules) == self._count:
            self._next = -math.inf
            if all(module.names for module in self.modules.values()):
                self._begin(Channels(list(self.modules.values())))

    def _begin(self, channels: Channels) -> None:
        suis = tuple(module.sui for module in channels.modules)
        self._first_seen = before = self._first_seen or suis
        replaced = f"modules {', '.join(map(str, suis))} in place of {', '.join(map(str, before))}"
        self.changed = "" if suis == before else replaced
        self._places = TaxelPlaces(channels.uid, self._config)
        self._channels = channels
        # Longest transfer time of the parts of one scan, s; the parts of four modules take 10 ms at 115 200 baud.
        self._scans = ScanAssembler(len(channels), max(self._period / 2, 0.015))

    def _keeps_period(self, stamp: float) -> bool:
        """Return True if scans keep the requested period; a board that missed the command or restarted has its own period."""
        self._stamps.append(stamp)
        # Least mean time between the watched scans, fraction of the requested period.
        if len(self._stamps) < WATCHED_SCANS or stamp - self._stamps[0] > 0.8 * self._period * (WATCHED_SCANS - 1):
            return True
        self._stamps.clear()
        return False

    def _add(self, message: Message, stamp: float) -> RawScan | None:
        if self._channels is None or self._scans is None or self._config.wire.start_up[self._step] != "start":
            return None
        part = self._channels.decode(message.payload, self._config.wire)
        incomplete = self._scans.incomplete
        scan = self._scans.add(part, stamp)
        self._incomplete += self._scans.incomplete - incomplete
        if scan is None:
            return None
        counts, begun = scan
        # Scans have no numbers: the number of missing scans follows from the time.
        missed = max(round((begun - self._stamps[-1]) / self._period) - 1, 0) if self._stamps else 0
        self.is_started, self._tries = self._keeps_period(begun), 0
        return self._places.scan(counts, begun, missed)
