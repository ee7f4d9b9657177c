"""The switch board behind a wire: its real firmware on an emulated ATmega328P, its UART on a pseudo-terminal."""

import ctypes
import math
import subprocess
import tempfile
from collections import deque
from functools import cache
from pathlib import Path

import numpy as np

import drivers
from drivers.errors import DeviceNotOpenedError
from sim.boards.terminal import Terminal
from sim.config import WireFaults
from sim.hand.switch import SwitchSource

FAULT_STREAM = 5
"""Key of the random stream for the line's faults."""
SOUND = WireFaults()
FREQUENCY = 16_000_000
"""Clock frequency of the emulated chip, cycles in one second."""
FIRMWARE = Path(drivers.__file__).parent / "switch" / "firmware" / "switch.hex"
_SOURCE = Path(__file__).with_suffix(".c")
_COMPILE = ("cc", "-O2", "-shared", "-fPIC", "-I/usr/include/simavr", str(_SOURCE), "-lsimavr", "-lelf", "-o")


@cache
def _library() -> ctypes.CDLL:
    """Compile the emulator once per process, and load it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "switch_board.so"
        try:
            subprocess.run([*_COMPILE, str(path)], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise DeviceNotOpenedError(
                "emulated switch board: cannot be compiled: apt-get install gcc libc6-dev libsimavr-dev libelf-dev"
            ) from error
        library = ctypes.CDLL(str(path))
    library.chip_new.restype = ctypes.c_void_p
    library.chip_bytes.restype = ctypes.POINTER(ctypes.c_uint8)
    library.chip_cycles.restype = ctypes.POINTER(ctypes.c_uint64)
    return library


class Chip:
    """An ATmega328P that runs on demand."""

    def __init__(self) -> None:
        """Power up the chip.

        Raises:
            DeviceNotOpenedError: There is no compiler, no libsimavr, or no firmware.
        """
        self._library = _library()
        self._chip = ctypes.c_void_p(self._library.chip_new(bytes(FIRMWARE)))
        if not self._chip:
            raise DeviceNotOpenedError(f"emulated switch board: {FIRMWARE} is no program for this chip")
        self.run(0, True, False)

    def stop(self) -> None:
        """Remove the chip's power; repeated calls are harmless."""
        self._library.chip_free(self._chip)

    def run(self, cycle: int, normally_open: bool, normally_closed: bool) -> list[tuple[int, int]]:
        """Run until `cycle` with these levels at the two pins, True for high.

        Returns:
            Bytes that left the UART meanwhile, each with the cycle at which its last bit ends.
        """
        count = self._library.chip_run(self._chip, ctypes.c_uint64(cycle), normally_open, normally_closed)
        if count < 0:
            raise DeviceNotOpenedError("emulated switch board: the firmware ran into something that is no program")
        cycles, sent = self._library.chip_cycles(self._chip), self._library.chip_bytes(self._chip)
        return list(zip(cycles[:count], sent[:count], strict=True))

    @property
    def resets(self) -> int:
        """Number of resets of the chip, including power-up; a boot loader runs after each."""
        return int(self._library.chip_resets(self._chip))

    def reset(self) -> None:
        """Activate the reset pin."""
        self._library.chip_reset(self._chip)

    def spoil_data(self, address: int, value: int) -> None:
        """Overwrite one byte of memory or a register, as an internal error of the chip does."""
        self._library.chip_spoil_data(self._chip, address, value)

    def spoil_program(self, address: int) -> None:
        """Flip one bit of the program."""
        self._library.chip_spoil_program(self._chip, address)


class EmulatedSwitchBoard:
    """The chip wired to the simulated hole, in simulated time and with configurable faults.

    The board reads the lever once in every step of the cell's clock; the level is at the chip's pins in the next step.
    """

    def __init__(self, source: SwitchSource, faults: WireFaults = SOUND, seed: int = 0) -> None:
        """Store the board's properties; nothing runs yet."""
        self._source = source
        self.faults = faults
        """Faults of the wire; callers may replace them at any time."""
        self.is_unplugged = False
        """True if the board's cable is unplugged, whatever `faults` contains."""
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(FAULT_STREAM,)))
        self._late: deque[tuple[float, bytes]] = deque()
        self._seen = -math.inf
        self._is_away = False
        self.terminal = Terminal("switch-board")
        """Far end of the board's serial port."""
        self.port = self.terminal.port
        """Name of the board's serial port."""
        self._chip: Chip | None = None
        self._start = 0.0
        self.is_pressed = False
        """True if the chip's pins show a pressed lever in the coming step."""

    def open(self) -> None:
        """Plug the board in, which powers it up; no effect if it is plugged in already."""
        if self._chip is None:
            self._chip = Chip()
            self._start = self._source.now()
            self.is_pressed = self._source.is_switch_pressed()
            self.terminal.plug_in()

    def close(self) -> None:
        """Unplug the board; repeated calls are harmless."""
        self.terminal.unplug()
        if self._chip is not None:
            self._chip.stop()
            self._chip = None

    def due(self) -> float:
        """Return infinity: the board reads the lever in every step of the cell's clock and needs no extra stop."""
        return math.inf

    def advance(self) -> None:
        """Run the chip to the present time and send its bytes."""
        self._suffer()
        if self._chip is None:
            return
        cycle = round((self._source.now() - self._start) * FREQUENCY)
        sent = self._chip.run(cycle, not self.is_pressed, self.is_pressed)
        self.is_pressed = self._source.is_switch_pressed()
        self._late.append((self._source.now() + self.faults.delay, bytes(byte for _, byte in sent)))
        while self._late and self._late[0][0] <= self._source.now():
            self.terminal.send(self._worn(self._late.popleft()[1]))

    def _suffer(self) -> None:
        """Unplug, plug in or reset the board as its faults require."""
        now, faults = self._source.now(), self.faults
        is_away = self.is_unplugged or any(start <= now < end for start, end in faults.unplugged)
        if is_away != self._is_away:
            self._is_away = is_away
            self._late.clear()
            (self.close if is_away else self.open)()
        if self._chip is not None and any(self._seen < instant <= now for instant in faults.resets):
            self._chip.reset()
        self._seen = now

    def _worn(self, data: bytes) -> bytes:
        """Return the bytes that pass a bad cable."""
        faults = self.faults
        if not faults.drop and not faults.corrupt:
            return data
        kept = [byte for byte in data if self._rng.random() >= faults.drop]
        return bytes(
            byte ^ (1 << int(self._rng.integers(8)) if self._rng.random() < faults.corrupt else 0) for byte in kept
        )
