"""The arm's 1 kHz torque loop, a process of its own: `python -m drivers.arm.loop HANDLE OPTIONS`.

The maker's library returns one state a millisecond and expects torques within the same millisecond. The process runs
nothing else: no other thread holds the interpreter, garbage collection is off, and the law is the compiled one of
`drivers.impedance`. The process ends when its standard input closes, which happens however the cell ends.
"""

import ctypes
import gc
import json
import logging
import math
import os
import select
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pylibfranka

from drivers import impedance, setpoint_words
from drivers.arm.franka_wire import wrench_on_hand
from drivers.arm.link import CYCLES_KEPT, TEXT, LoopLink, LoopPhase, compile_law, holding_words
from drivers.arm.loop_figures import PRIORITY
from drivers.arm.model import JOINTS
from drivers.quantities import Vector

logger = logging.getLogger(__name__)

NEEDED_SYSTEM = "pylibfranka 0.21.3 needs system 5.9 or later: update the arm's system in Desk, or install the pylibfranka that fits it"
"""Source: compatibility_matrix.rst of the library, for the version that `constraints.txt` pins."""
NOT_READY = "unlock the brakes, choose execution and activate the control interface in Desk, then reset"
"""Remedy if the arm refuses a motion in its present mode."""


class TorqueLoop:
    """Follows the setpoint of the link until the standard input closes."""

    def __init__(
        self,
        link: LoopLink,
        host: str,
        realtime: str,
        torque: float,
        force: float,
        figures: list[float],
        law: list[float],
        period: float,
    ) -> None:
        """Take the shared block, and the address and figures of the arm.

        Args:
            link: The shared block.
            host: Address of the arm.
            realtime: Requirement of a real-time kernel, `enforce` or `ignore`.
            torque: Joint torque at which the arm's reflex stops it, N·m.
            force: Force at the hand at which the arm's reflex stops it, N.
            figures: Figures of the arm, see `drivers.impedance.figures`.
            law: State of the law at the beginning, see `drivers.impedance.new_state`.
            period: Period of the loop, s.
        """
        self._link, self._host, self._realtime = link, host, realtime
        self._collision = [torque] * JOINTS, [force] * 6
        self._figures, self._period = np.array(figures), period
        rates = self._figures[impedance.TORQUE_RATE : impedance.TORQUE_RATE + JOINTS]
        # Share of the permitted torque rate in use, fraction; at the limit itself, rounding would exceed it.
        self._step = 0.98 * rates * period
        self._robot: Any = None
        self._sent = np.zeros(JOINTS)
        self._time = 0.0
        self._taken = -1
        self._words = holding_words()
        self._law = np.array(law)

    def run(self) -> None:
        """Connect, control, wait for a reset after a fault, and repeat."""
        compile_law(self._figures, self._law, self._period)  # before the first cycle needs it
        while not _is_over():
            try:
                if self._robot is None:
                    self._connect()
                self._control()
            except pylibfranka.FrankaException as error:  # incompatible system; not a base of the errors below
                self._robot = None
                self._fail(LoopPhase.REFUSED, f"{str(error).partition(').')[0]}); {NEEDED_SYSTEM}")
            except pylibfranka.NetworkException as error:
                self._robot = None
                self._fail(LoopPhase.LOST, str(error))
            except RuntimeError as error:  # base of the library's remaining errors
                is_refused = "current mode" in str(error)
                self._fail(self._phase_of_stop(), f"{error}; {NOT_READY}" if is_refused else str(error))
            else:
                return
            if not self._wait_for_reset():
                return

    def _connect(self) -> None:
        config = pylibfranka.RealtimeConfig
        self._robot = pylibfranka.Robot(self._host, config.kEnforce if self._realtime == "enforce" else config.kIgnore)

    def _control(self) -> None:
        """Run cycles until the standard input ends and the arm is braked.

        Raises:
            RuntimeError: The arm ended the motion or refuses one, or the time for a start has passed.
        """
        control = self._start()
        q, dq, last, count, end = np.empty(JOINTS), np.empty(JOINTS), time.monotonic(), 0, math.inf
        while True:
            state, passed = control.readOnce()
            woke = time.monotonic()
            self._time += passed.to_sec()
            q[:], dq[:] = state.q, state.dq
            # Number of cycles between two checks of the standard input.
            if count % 50 == 0 and end == math.inf and _is_over():
                # Longest braking time before the motion ends, s of the arm's time.
                end = self._time + 1.0
                self._words[:] = holding_words()
            if end == math.inf:
                self._take()
            command = pylibfranka.Torques(self._torques(state, q, dq))
            count += 1
            # Speed of the fastest joint below which a motion may end, rad/s.
            command.motion_finished = end < math.inf and (np.abs(dq).max() < 0.01 or self._time > end)
            control.writeOnce(command)
            if command.motion_finished:
                return
            done = time.monotonic()
            self._count(state, done - woke, woke - last, passed.to_sec(), count == 1)
            last = woke
            self._publish(state, q, dq)
            # The first state is available only now.
            self._link["phase"][0] = LoopPhase.RUNNING

    def _start(self) -> Any:
        """Start torque control and return it.

        Raises:
            RuntimeError: The arm refuses the motion, or the time for a start has passed.
        """
        impedance.restart(self._law)
        # In a reflex or a user stop the arm refuses thresholds, so they are set before every start.
        torque, force = self._collision
        self._robot.set_collision_behavior(torque, torque, force, force)
        if time.monotonic() > self._link["start_by"][0]:
            raise RuntimeError("the arm recovered after its reset had expired: reset again")
        control, self._sent = self._robot.start_torque_control(), np.zeros(JOINTS)
        return control

    def _count(self, state: Any, busy: float, spacing: float, passed: float, is_first: bool) -> None:
        """Record a cycle: its working time, the time since the previous one, the arm's time between their states, s."""
        link = self._link
        place = int(link["cycles"][0]) % CYCLES_KEPT
        link["busy"][0, place], link["spacing"][0, place] = busy, spacing
        link["cycles"][0] += 1
        link["success"][0] += state.control_command_success_rate
        if is_first:
            link["end_effector"][0], link["load"][0] = state.m_ee, state.m_load
        else:
            link["missed"][0] += max(round(passed / self._period) - 1, 0)

    def _torques(self, state: Any, q: Vector, dq: Vector) -> list[float]:
        """Return the torques of one cycle, N·m, within the arm's limits."""
        own = slice(impedance.TORQUE, impedance.TORQUE + JOINTS)
        applied, sent, step = np.array(state.tau_J_d), self._sent, self._step
        self._law[own] = applied
        tau = impedance.torque(self._figures, self._words, self._law, q, dq, self._time, self._period)
        # |tau - sent| <= step and |tau - tau_J_d| <= step: the limit holds whether the last command arrives late or is lost.
        tau = np.clip(np.clip(tau, sent - step, sent + step), applied - step, applied + step)
        self._law[own] = self._sent = tau
        torques: list[float] = tau.tolist()
        return torques

    def _take(self) -> None:
        """Take over a new setpoint; if the cell is still writing the setpoint, take it over one cycle later."""
        link = self._link
        count = link.is_settled("setpoint_sequence")
        if count is None or count == self._taken:
            return
        words = link["words"][0].copy()
        if link.is_settled("setpoint_sequence") != count:
            return
        self._taken = count
        # The setpoint carries its remaining validity, so the two clocks need not agree.
        words[setpoint_words.VALID_UNTIL] += self._time
        self._words[:] = words
        self._law[impedance.IS_HOLDING] = 0.0

    def _publish(self, state: Any, q: Vector, dq: Vector) -> None:
        link = self._link
        tcp, _, _, _ = impedance.forward(self._figures, q)
        force, torque = wrench_on_hand(state.O_F_ext_hat_K, state.O_T_EE, state.EE_T_K, tcp)
        link.begin("state_sequence")
        link["q"][0], link["dq"][0] = q, dq
        link["commanded"][0] = impedance.commanded(self._law)
        link["unexplained"][0] = impedance.unexplained(self._law)
        link["force"][0], link["torque"][0] = force, torque
        link.end("state_sequence")

    def _fail(self, phase: LoopPhase, text: str) -> None:
        self._link["text"][0] = text.replace("\n", " ").encode("ascii", "replace")[:TEXT]
        self._link["phase"][0] = phase
        self._link["failures"][0] += 1

    def _phase_of_stop(self) -> LoopPhase:
        """Return STOPPED or REFLEX, depending on what holds the arm; LOST without a connection."""
        if self._robot is None:
            return LoopPhase.LOST
        stops = (pylibfranka.RobotMode.UserStopped, pylibfranka.RobotMode.Guiding)
        try:
            return LoopPhase.STOPPED if self._robot.read_once().robot_mode in stops else LoopPhase.REFLEX
        except RuntimeError:
            self._robot = None
            return LoopPhase.LOST

    def _wait_for_reset(self) -> bool:
        """Keep the state fresh until the cell requests a reset; return False if the cell ended instead."""
        link = self._link
        self._words[:] = holding_words()
        while True:
            if _is_over():
                return False
            if link["resets"][0] != link["resets_done"][0]:
                if self._robot is not None:
                    self._try(self._robot.automatic_error_recovery)
                link["resets_done"][0] = link["resets"][0]
                return True
            if self._robot is None:
                # Time between two attempts to connect while the connection is lost, s.
                time.sleep(0.1)
            else:
                self._try(self._read_idle)

    def _read_idle(self) -> None:
        state = self._robot.read_once()
        self._publish(state, np.array(state.q), np.array(state.dq))

    def _try(self, action: Callable[[], object]) -> None:
        try:
            action()
        except pylibfranka.NetworkException as error:
            self._robot = None
            self._fail(LoopPhase.LOST, str(error))
        except RuntimeError as error:
            logger.info("%s", error)


def _is_over() -> bool:
    """Return True if the other end of the standard input is closed."""
    readable, _, _ = select.select([sys.stdin], [], [], 0.0)
    return bool(readable)


def become_realtime() -> bool:
    """Request a real-time priority and locked memory; return True if both were granted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        return False
    everything = 3  # MCL_CURRENT | MCL_FUTURE
    return bool(ctypes.CDLL(None).mlockall(everything) == 0)


def main() -> None:
    """Run the loop for the cell that started this process."""
    link = LoopLink(int(sys.argv[1]))
    options = json.loads(sys.argv[2])
    link["is_realtime"][0] = become_realtime() if options["realtime"] == "enforce" else False
    gc.freeze()
    gc.disable()
    TorqueLoop(link, **options).run()


if __name__ == "__main__":
    main()
