"""A Franka arm as an Arm: the torque loop runs in its own process; this class writes setpoints and reads states.

Written for the FR3 with the maker's `pylibfranka` (extra `franka`). The Panda of [gibbons] uses an older protocol: for it,
`drivers/arm/loop.py` must use the older library (`panda-python` includes it); the rest is the same for both arms. The
driver was tested only on simulated arms, on no real FR3, Panda or other arm.
"""

import json
import math
import os
import subprocess
import sys
import time
from importlib.util import find_spec

from drivers import impedance, setpoint_words
from drivers.arm.franka_config import FrankaArmConfig
from drivers.arm.link import CYCLES_KEPT, SIZE, LoopLink, LoopPhase, compile_law, holding_words
from drivers.arm.loop_figures import LoopFigures, Times
from drivers.arm.model import ArmModel
from drivers.errors import ArmReflexError, ArmSilentError, ArmStoppedError, CellError, DeviceNotOpenedError
from drivers.protocols import Clock
from drivers.quantities import ArmState, ImpedanceSetpoint, Pose, Vector, Wrench

CONNECT_TIME = 20.0
"""Longest time until the loop runs, s of wall time: start of the interpreter, load of the compiled law, connection."""
RESET_TIME = 5.0
"""Longest time for the arm's error recovery, s of wall time. If it takes longer, the arm stays still and needs another reset."""
POLL_PERIOD = 0.005
"""Time between two polls of the shared block while the driver waits, s of wall time."""
_ERRORS: dict[LoopPhase, type[CellError]] = {
    LoopPhase.REFLEX: ArmReflexError,
    LoopPhase.STOPPED: ArmStoppedError,
    LoopPhase.LOST: ArmSilentError,
    LoopPhase.REFUSED: DeviceNotOpenedError,
}


class FrankaArm:
    """Writes setpoints to the torque loop, and reads its newest state."""

    def __init__(self, config: FrankaArmConfig, arm: ArmModel, clock: Clock, law: Vector | None = None) -> None:
        """Describe the arm.

        Args:
            config: Address of the arm, and its collision thresholds.
            arm: Figures of the arm.
            clock: The cell's clock.
            law: Initial state of the law, shape (STATE_WORDS,); None if the arm's joints have not been measured.
        """
        self._config, self._clock = config, clock
        self._arm, self._figures = arm, impedance.figures(arm)
        self._law = impedance.new_state(arm) if law is None else law
        self._process: subprocess.Popen[bytes] | None = None
        self._link: LoopLink | None = None
        self._is_open = False
        self._handed = self._valid_until = -math.inf
        self._seen, self._seen_at = -1, -math.inf

    def open(self) -> None:
        """Start the loop and wait until the arm answers; the arm then holds still.

        An arm can be opened even if a reflex or a stop holds it: `read` then raises, and a reset recovers the arm.
        """
        if self._is_open:
            return
        if find_spec("pylibfranka") is None:
            raise DeviceNotOpenedError(
                "arm: pylibfranka is not installed: pip install 'tactile-insertion-cell[franka]'"
            )
        # The cell compiles the law first, because the loop's process must start within `CONNECT_TIME`.
        compile_law(self._figures, self._law, self._arm.control_period)
        self._start()
        self._is_open = True

    def _start(self) -> None:
        options = {
            "host": self._config.host,
            "realtime": self._config.realtime,
            "torque": self._config.collision_torque,
            "force": self._config.collision_force,
            "figures": self._figures.tolist(),
            "law": self._law.tolist(),
            "period": self._arm.control_period,
        }
        start_by = time.monotonic() + CONNECT_TIME
        handle = os.memfd_create("arm")
        try:
            os.ftruncate(handle, SIZE)
            self._link = LoopLink(handle)
            self._link["start_by"][0] = start_by
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "drivers.arm.loop", str(handle), json.dumps(options)],
                stdin=subprocess.PIPE,
                pass_fds=(handle,),
            )
        finally:
            os.close(handle)
        while self.phase is LoopPhase.CONNECTING and time.monotonic() < start_by and self._is_alive():
            time.sleep(POLL_PERIOD)
        phase, where = self.phase, f"arm at {self._config.host}"
        if phase in (LoopPhase.CONNECTING, LoopPhase.LOST, LoopPhase.REFUSED):
            text = self._text() or "no answer"
            self._end()
            if phase is LoopPhase.REFUSED:
                raise DeviceNotOpenedError(f"{where}: {text}")
            raise DeviceNotOpenedError(
                f"{where}: {text}; check address, cable, its control interface, "
                "and that this computer runs a real-time kernel"
            )

    def close(self) -> None:
        """End the motion and the loop."""
        self._is_open = False
        self._end()

    def _end(self) -> None:
        if self._process is not None:
            assert self._process.stdin is not None
            self._process.stdin.close()
            try:
                # Longest time for the loop to brake the arm and to end, s of wall time.
                self._process.wait(timeout=5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = self._link = None

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Hold `setpoint` until the next one or until its validity ends."""
        now = self._clock.now()
        words = setpoint_words.pack(setpoint, now)
        words[setpoint_words.VALID_UNTIL] = setpoint.valid_until - now
        self._handed, self._valid_until = now, setpoint.valid_until
        self._hand_over(words)

    def halt(self) -> None:
        """Hold still at the present pose, compliant."""
        self._handed = self._valid_until = -math.inf
        self._hand_over(holding_words())

    def reset(self) -> None:
        """Leave a reflex or a released stop, restore a lost connection, or restart an ended loop; then hold still."""
        if self._is_open and not self._is_alive():
            self._end()
            self._start()
        link = self._opened()
        self.halt()
        before, failures = self.phase, int(link["failures"][0])
        if before is not LoopPhase.RUNNING:
            start_by = time.monotonic() + RESET_TIME
            link["start_by"][0] = start_by
            link["resets"][0] += 1
            # Longest time from the end of the recovery to the first cycle of torque control, s of wall time.
            while time.monotonic() < start_by + 1.0 and self._is_alive():
                is_over = self.phase is LoopPhase.RUNNING or link["failures"][0] != failures
                if is_over and link["resets_done"][0] == link["resets"][0]:
                    break
                time.sleep(POLL_PERIOD)
        self._require_running()

    def read(self) -> ArmState:
        """Return the newest state; see `drivers.protocols.Arm`.

        Raises:
            ArmSilentError: The newest state is too old, or the loop has ended.
        """
        silent = 0.1  # Longest time without a new state, s on the cell's clock; the arm sends one every millisecond.
        link = self._opened()
        while True:
            self._require_running()  # ends the wait if the loop was killed in the middle of a write
            count = link.is_settled("state_sequence")
            told = ("q", "dq", "force", "torque", "commanded", "unexplained")
            q, dq, force, torque, commanded, unexplained = (link[name][0].copy() for name in told)
            if count is not None and link.is_settled("state_sequence") == count:
                break
        now = self._clock.now()
        if count != self._seen:
            self._seen, self._seen_at = count, now
        elif now - self._seen_at > silent:
            raise ArmSilentError(
                f"arm at {self._config.host}: no new state for {now - self._seen_at:.3f} s > {silent} s limit"
            )
        position, rotation, _, _ = impedance.forward(self._figures, q)
        return ArmState(
            stamp=now,
            q=q,
            dq=dq,
            tcp=Pose(position, rotation),
            elbow=self._arm.kinematics.elbow - 1,
            wrench=Wrench(force, torque),
            setpoint_age=now - self._handed if self._valid_until >= now else math.inf,
            commanded=commanded,
            unexplained=unexplained,
        )

    @property
    def phase(self) -> LoopPhase:
        """Phase of the torque loop."""
        return LoopPhase.LOST if self._link is None else LoopPhase(int(self._link["phase"][0]))

    def figures(self) -> LoopFigures:
        """Return the timing of the loop, and the masses that the arm reports."""
        link = self._opened()
        cycles = int(link["cycles"][0])
        kept = slice(1 if cycles <= CYCLES_KEPT else 0, min(cycles, CYCLES_KEPT))
        return LoopFigures(
            cycles=cycles,
            missed=int(link["missed"][0]),
            success_rate=float(link["success"][0]) / max(cycles, 1),
            busy=Times.of(link["busy"][0, kept]),
            spacing=Times.of(link["spacing"][0, kept]),
            is_realtime=bool(link["is_realtime"][0]),
            end_effector=float(link["end_effector"][0]),
            load=float(link["load"][0]),
        )

    def _hand_over(self, words: Vector) -> None:
        if self._link is not None:
            self._link.begin("setpoint_sequence")
            self._link["words"][0] = words
            self._link.end("setpoint_sequence")

    def _opened(self) -> LoopLink:
        if self._link is None:
            raise ArmSilentError("arm: not open")
        return self._link

    def _require_running(self) -> None:
        if not self._is_alive():
            raise ArmSilentError(f"arm at {self._config.host}: its torque loop has ended; a reset starts it again")
        if self.phase in _ERRORS:
            raise _ERRORS[self.phase](f"arm at {self._config.host}: {self._text()}")

    def _is_alive(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def _text(self) -> str:
        return bytes(self._opened()["text"][0]).decode("ascii")
