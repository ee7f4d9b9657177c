"""The Franka hand as a Gripper; the maker's library blocks and therefore runs in its own process."""

import math
import os
import subprocess
import sys
import time
from importlib.util import find_spec

from drivers.errors import DeviceNotOpenedError, GripperSilentError
from drivers.gripper.franka_config import FrankaGripperConfig
from drivers.quantities import GripperState

COMMAND_TIME = 10.0
"""Longest time of one command, s of wall time; the whole stroke takes 8 s at the lowest speed allowed."""


class FrankaGripper:
    """Sends a command only if it differs from the last one. If a grasp closes on nothing, the state shows no grip."""

    def __init__(self, config: FrankaGripperConfig, stroke: float) -> None:
        """Describe the hand; `stroke` is the largest distance between its pads, m."""
        self._config, self._stroke = config, stroke
        self._process: subprocess.Popen[bytes] | None = None
        self._started, self._failed = 0.0, ""
        self._forget()

    def open(self) -> None:
        """Connect to the hand; the fingers do not move."""
        if self._process is not None:
            return
        if find_spec("pylibfranka") is None:
            raise DeviceNotOpenedError(
                "gripper: pylibfranka is not installed: pip install 'tactile-insertion-cell[franka]'"
            )
        self._start()
        # Longest wait for the first state of the hand, s of wall time.
        while self._width is None and not self._lost and time.monotonic() < self._started + 20.0:
            time.sleep(0.01)
            self._listen()
        if self._width is None:
            self.close()
            raise DeviceNotOpenedError(
                f"gripper at {self._config.host}: {self._lost or 'no answer'}; "
                "check that the hand is connected and homed"
            )

    def _start(self) -> None:
        self._forget()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "drivers.gripper.loop", self._config.host],
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdout.fileno(), False)
        self._started = time.monotonic()

    def close(self) -> None:
        """Disconnect; the hand keeps its grip."""
        if self._process is not None:
            for pipe in (self._process.stdin, self._process.stdout):
                assert pipe is not None
                pipe.close()
            try:
                self._process.wait(timeout=COMMAND_TIME)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None

    def grip(self, force: float) -> None:
        """Close until `force`, N, is held or the fingers meet."""
        self._command(f"grasp 0 {self._config.speed} {force} {self._stroke} {self._stroke}")

    def release(self, width: float) -> None:
        """Open to `width`, m."""
        self._command(f"move {width} {self._config.speed}")

    def read(self) -> GripperState:
        """Return the newest state. If the process has ended, restart it; the fingers do not move.

        Raises:
            GripperSilentError: The newest state is too old, or a command takes too long. If the hand refused a
                command, or did not open, this is raised once.
        """
        self._listen()
        self._revive()
        where = f"gripper at {self._config.host}"
        told, self._failed = self._lost or self._failed, ""
        if told:
            raise GripperSilentError(f"{where}: {told}")
        # Age at which a state is too old, s of wall time.
        age, limit = time.monotonic() - self._heard, COMMAND_TIME if self._is_busy else 1.0
        if self._width is None or age > limit:
            raise GripperSilentError(f"{where}: newest state {age:.3f} s old > {limit} s limit")
        # Width below which the fingers have met with nothing between them, m.
        is_gripping = self._is_grasped and self._width > 0.001 and not self._is_busy
        return GripperState(width=self._width, is_gripping=is_gripping, is_moving=self._is_busy)

    def _forget(self) -> None:
        self._lines, self._number = b"", 0
        self._width: float | None = None
        self._is_grasped = self._is_busy = False
        self._done_at, self._has_grasped = math.inf, False
        self._heard, self._lost, self._failed, self._last = time.monotonic(), "", "", ""

    def _command(self, line: str) -> None:
        self._listen()
        if self._process is None or self._process.poll() is not None or self._lost:
            raise GripperSilentError(f"gripper at {self._config.host}: {self._lost or 'not open'}")
        if line == self._last:
            return
        assert self._process.stdin is not None
        self._number += 1
        try:
            self._process.stdin.write(f"{self._number} {line}\n".encode())
        except BrokenPipeError:
            raise GripperSilentError(f"gripper at {self._config.host}: its process has ended") from None
        self._last, self._heard = line, time.monotonic()
        self._is_busy, self._is_grasped = True, False
        self._done_at, self._has_grasped = math.inf, False

    def _revive(self) -> None:
        """Restart the process if it has ended; the hand counts as lost until it reports a state."""
        if self._process is None or self._process.poll() is None:
            return
        # Time between two attempts to start a process that has ended, s of wall time.
        if time.monotonic() >= self._started + 2.0:
            self.close()
            self._start()
        self._lost = "its process has ended and is being restarted"

    def _listen(self) -> None:
        if self._process is None or self._process.stdout is None:
            return
        self._lines += self._process.stdout.read() or b""
        *whole, self._lines = self._lines.split(b"\n")
        for line in whole:
            self._hear(line.decode())

    def _hear(self, line: str) -> None:
        word, _, rest = line.partition(" ")
        self._heard = time.monotonic()
        if word in ("done", "failed"):
            number, _, rest = rest.partition(" ")
            if int(number) != self._number:
                return  # a newer command has replaced this one
        if word == "state":
            width, is_grasped = rest.split()
            # Longest time from the end of a grasp to a state that shows it, s of wall time; both arrive independently.
            is_settled = is_grasped == "1" or not self._has_grasped or self._heard > self._done_at + 0.2
            self._lost, self._is_busy = "", self._is_busy and not (self._done_at < math.inf and is_settled)
            if not self._is_busy:
                self._width, self._is_grasped = float(width), is_grasped == "1"
        elif word == "done":
            # The next state gives the position of the fingers.
            self._done_at, self._has_grasped = self._heard, rest == "grasp 1"
            if rest == "move 0":
                self._failed, self._last = "the hand did not open", ""
        elif word == "failed":
            self._failed, self._is_busy, self._last = rest, False, ""
        else:
            self._lost, self._is_busy, self._last = rest, False, ""
