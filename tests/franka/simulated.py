"""An FR3 and its hand as their maker's client sees them: franka-sim's protocol server around this project's own world.

Needs franka-sim and the client in a folder of their own, without the older packages that franka-sim asks for:

    python3 -m pip install --no-deps --target build/franka -c constraints.txt franka-sim pylibfranka
    PYTHONPATH=build/franka .venv/bin/pytest tests/franka

One published state is one millisecond of the world: the server waits for the client's torques, the world steps with
them, and the next state shows the result. A busy machine makes everything slower and changes nothing else.
"""

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ParamSpec

import numpy as np
from franka_sim.control_modes import ControlMode
from franka_sim.franka_protocol import Command, ConnectStatus, MessageHeader, MoveStatus, RobotMode
from franka_sim.franka_sim_server import FrankaSimServer
from franka_sim.gripper.backend import GripperBackend, GripperStateData

from cell.config.cell_config import CellConfig
from drivers import impedance
from drivers.arm.franka import FrankaArm
from drivers.arm.franka_config import FrankaArmConfig
from drivers.arm.model import ArmModel
from drivers.protocols import Clock
from drivers.quantities import Vector
from sim.hand.gripper import SimGripper
from sim.world.physics import World

P = ParamSpec("P")

HOLD_STIFFNESS = np.array([600.0, 600.0, 600.0, 250.0, 60.0, 30.0, 10.0])
"""With which the arm's own controller holds its place while nobody commands torques, N·m/rad."""
HOLD_DAMPING = np.array([40.0, 40.0, 40.0, 20.0, 4.0, 2.0, 1.0])
"""N·m·s/rad."""
NEVER = 2**40
PATIENCE = 0.7
"""Longest wait for the client's torques when lateness shall not count, s of wall time; the client waits 1 s for a state."""
AHEAD = 0.004
"""Longest time by which the world is ahead of another process that keeps its time, s."""
LOOK = 5e-4
"""Time between two looks at that process's time, s of wall time."""
PAUSE = 0.05
"""Longest time without a state for the client, s of wall time: it would take the arm for lost."""
STILL = 0.1
"""Time for which the fingers stand still before the hand reports arrival, s."""


class TorqueWorld(World):
    """The cell's world, whose arm is moved by torques from outside instead of by its own law."""

    def __init__(self, config: CellConfig) -> None:
        assert config.sim is not None
        assert config.contact is not None
        assert config.grip is not None
        sim = config.sim.model_copy(update={"pace": "max"})
        super().__init__(config.arm_model(), sim, config.contact, config.grip, config.skin.layout, config.job())
        self.beat = self.beat._replace(law_every=NEVER)

    def step(self, torque: Vector) -> None:
        self.command(torque)
        self.wait_until(self.now() + self.arm.control_period)


@dataclass
class Arm:
    """The world as franka-sim wants its physics; also the cell's clock."""

    world: TorqueWorld
    enable_vis: bool = False
    is_running: bool = True
    horizon: float = float("inf")
    """The world goes no further than this while the cell computes, s."""
    lock: threading.Condition = field(default_factory=lambda: threading.Condition(threading.RLock()))
    mode: ControlMode = ControlMode.POSITION
    torques: Vector = field(default_factory=lambda: np.zeros(7))
    held: Vector = field(default_factory=lambda: np.zeros(7))
    stopped: threading.Event = field(default_factory=threading.Event)
    largest_rate: float = 0.0
    """Largest change of a torque command within one millisecond so far, N·m/s."""
    speed_at_end: float = 0.0
    """Speed of the fastest joint when torque control last ended, rad/s."""
    push: Callable[[], Vector] = lambda: np.zeros(3)
    """Function that returns the force of a person on the hand, shape (3,), N, base frame."""
    has_client: Callable[[], bool] = lambda: False
    """Function that returns True while states are sent to a client."""
    shown: Vector = field(default_factory=lambda: np.full(2, np.inf))
    """Time of the world for another process, and the time that it has seen, infinite if there is none, shape (2,), s."""
    after: Callable[[], None] = lambda: None
    """Function called after every step, between two steps."""

    def __post_init__(self) -> None:
        self.figures = impedance.figures(self.world.arm)
        self.world.step(np.zeros(7))  # compiles, before a client waits for states
        self.held = self.world.q

    # What franka-sim calls.

    def initialize_simulation(self) -> None: ...

    def start(self) -> None:
        self.stopped.wait()

    def stop(self) -> None:
        self.is_running = False
        self.stopped.set()

    def set_control_mode(self, mode: ControlMode) -> None:
        if self.mode is ControlMode.TORQUE and mode is not ControlMode.TORQUE:
            self.speed_at_end = float(np.abs(self.world.dq).max())
        self.mode = mode

    def update_torques(self, torques: Any) -> None:
        new = np.asarray(torques, dtype=float)
        if self.mode is ControlMode.TORQUE and new.any():
            self.largest_rate = max(
                self.largest_rate, float(np.abs(new - self.torques).max()) / self.world.arm.control_period
            )
        self.torques = new

    def update_joint_positions(self, positions: Any) -> None:
        self.held = np.asarray(positions, dtype=float)

    def update_joint_velocities(self, velocities: Any) -> None: ...

    def get_robot_state(self) -> dict[str, Any]:
        with self.lock:
            q, dq = self.world.q, self.world.dq
            force, torque = self.world.contact_force() + self.push(), self.world.contact_torque()
            position, rotation, _, _ = impedance.forward(self.figures, q)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, position
        return {
            "q": q,
            "dq": dq,
            "ddq": np.zeros(7),
            "q_d": self.held,
            "dq_d": dq,
            "ddq_d": np.zeros(7),
            "tau_J": self.torques,
            "O_T_EE": pose.T.flatten(),
            "O_dP_EE": np.zeros(3),
            "O_J_EE": np.eye(6, 7),
            # The wrench of the robot on the environment: robot_state.h of libfranka.
            "O_F_ext_hat_K": [*-force, *-torque],
            "m_ee": self.world.arm.hand.body.mass + 2.0 * self.world.arm.hand.finger.mass,
            "m_load": 0.0,
            "self_collision": None,
        }

    def step(self) -> None:
        """Advance by one millisecond with what is commanded, once the cell lets the world go on.

        While the cell computes for longer, the client gets the same state again, and the world stands still.
        """
        end = time.monotonic() + PAUSE
        while self.world.now() >= self.shown[1] + AHEAD and self.is_running:
            if time.monotonic() > end:
                return
            time.sleep(LOOK)
        with self.lock:
            if not self.lock.wait_for(lambda: self.world.now() < self.horizon or not self.is_running, timeout=PAUSE):
                return
            if self.mode is ControlMode.TORQUE:
                torque = self.torques
            else:
                torque = HOLD_STIFFNESS * (self.held - self.world.q) - HOLD_DAMPING * self.world.dq
            most = np.array(self.world.arm.joints.torque)
            place, _, axes, origins = impedance.forward(self.figures, self.world.q)
            self.world.step(np.clip(torque, -most, most) + np.cross(axes, place - origins) @ self.push())
            self.shown[0] = self.world.now()
            self.after()
            self.lock.notify_all()

    def between_steps(self, act: Callable[P, None]) -> Callable[P, None]:
        """Return an act of a person at the cell that never happens within a step."""

        def locked(*args: P.args, **kwargs: P.kwargs) -> None:
            with self.lock:
                act(*args, **kwargs)

        return locked

    # The clock of the cell.

    def now(self) -> float:
        return self.world.now()

    def wait_until(self, stamp: float) -> None:
        """Let the world go on until `stamp`, s. Without a client the arm's own controller holds its place meanwhile."""
        with self.lock:
            self.horizon = stamp - 1e-6
            self.lock.notify_all()
            while self.world.now() < self.horizon and self.is_running:
                if self.has_client():
                    self.lock.wait(timeout=PAUSE)
                else:
                    self.step()


class Seen:
    """The world as skin, switch and their boards see it, between two of its steps."""

    def __init__(self, arm: Arm) -> None:
        self._arm = arm

    def now(self) -> float:
        return self._arm.world.now()

    def wait_until(self, stamp: float) -> None:
        self._arm.wait_until(stamp)

    @property
    def draw(self) -> Any:
        return self._arm.world.draw

    def pad_load(self) -> Any:
        with self._arm.lock:
            return self._arm.world.pad_load()

    def is_switch_pressed(self) -> bool:
        with self._arm.lock:
            return self._arm.world.is_switch_pressed()


class Hand(GripperBackend):
    """The world's hand as franka-sim wants its gripper: a command returns when the fingers rest."""

    def __init__(self, arm: Arm) -> None:
        self._arm, self._gripper = arm, SimGripper(arm.world)

    def homing(self) -> bool:
        return True

    def stop(self) -> bool:
        return True

    def move(self, width: float, speed: float) -> bool:
        with self._arm.lock:
            self._gripper.release(width)
        self._rest()
        return True

    def grasp(self, width: float, epsilon_inner: float, epsilon_outer: float, speed: float, force: float) -> bool:
        with self._arm.lock:
            self._gripper.grip(force)
        self._rest()
        state = self._state()
        return width - epsilon_inner < state.width < width + epsilon_outer

    def get_state(self) -> GripperStateData:
        state = self._state()
        return GripperStateData(state.width, self._arm.world.arm.hand.stroke, state.is_gripping, 30)

    def _state(self) -> Any:
        with self._arm.lock:
            return self._gripper.read()

    def _rest(self) -> None:
        with self._arm.lock:
            moved = begun = self._arm.world.now()
            while (now := self._arm.world.now()) < min(moved + STILL, begun + 3.0) and self._arm.is_running:
                moved = now if self._gripper.read().is_moving else moved
                self._arm.lock.wait(timeout=5.0)


class Server(FrankaSimServer):  # type: ignore[misc]  # no hints
    """Steps the world between the client's answer and the next state."""

    is_patient = True
    """Wait for the client's torques however busy the machine is; False counts a late answer as lost, as the arm does."""
    system = 10
    """Version of the control interface that the arm's system speaks; a client of another one is refused."""
    is_hurried = False
    """Send a state as soon as the client's torques for the last one are applied, not a millisecond of wall time later."""
    is_stopped = False
    """The stop button is kept pressed."""
    is_braked = False
    """The brakes are closed, or Desk is not in execution."""
    loss = 0.0
    """Share of the client's torques that do not arrive."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.may_recover = threading.Event()
        """Set while the arm's error recovery can end."""
        self.may_recover.set()
        self.thresholds_set = 0
        """Number of collision thresholds that the arm has accepted."""
        self._draws = np.random.default_rng(1)

    def send_response(self, client_socket: Any, command: int, command_id: int, status: Any, version: int) -> None:
        is_refused = self.system != version
        super().send_response(
            client_socket,
            command,
            command_id,
            ConnectStatus.kIncompatibleLibraryVersion if is_refused else status,
            self.system,
        )

    def _refuse(self, client_socket: Any, command: Command, header: Any) -> None:
        self._send_tcp(client_socket, MessageHeader(command, header.command_id, 16).to_bytes() + bytes([2, 0, 0, 0]))

    def handle_automatic_error_recovery_command(self, client_socket: Any, header: Any, payload: bytes) -> None:
        """Refuse to recover while the stop is pressed, as the arm does."""
        self.may_recover.wait()
        if self.is_stopped:
            self._refuse(client_socket, Command.kAutomaticErrorRecovery, header)
        else:
            super().handle_automatic_error_recovery_command(client_socket, header, payload)

    def handle_set_collision_behavior_command(self, client_socket: Any, header: Any, payload: bytes) -> None:
        """Refuse thresholds in a reflex or a pressed stop, as the arm does."""
        if self.is_stopped or self.robot_state.state["robot_mode"] == RobotMode.kReflex:
            self._refuse(client_socket, Command.kSetCollisionBehavior, header)
            return
        self.thresholds_set += 1
        super().handle_set_collision_behavior_command(client_socket, header, payload)

    def handle_move_command(self, client_socket: Any, header: Any, payload: bytes) -> None:
        """Refuse a motion while the brakes are closed, as the arm does."""
        if self.is_braked:
            self.send_move_response(client_socket, header.command_id, MoveStatus.kCommandNotPossibleRejected)
        else:
            super().handle_move_command(client_socket, header, payload)

    def _absorb_within_motion_limits(self, command: Any, *, fresh: bool) -> bool:
        if self.loss and self._draws.random() < self.loss:
            return False
        absorbed: bool = super()._absorb_within_motion_limits(command, fresh=fresh)
        return absorbed

    def press_stop(self) -> None:
        """Press and release the stop button: it stops the motion without an error, and in a mode of its own."""
        with self._motion_lock:
            self._abort_with_error((), "stop button")
            self.robot_state.state["robot_mode"] = RobotMode.kUserStopped.value

    def cut(self) -> None:
        self.client_socket.shutdown(socket.SHUT_RDWR)

    @property
    def _DRAIN_GATE_TIMEOUT(self) -> float:  # noqa: N802  # the server's name of its longest wait for an answer that has arrived
        longest: float = PATIENCE if self.is_patient else super()._DRAIN_GATE_TIMEOUT
        return longest

    def _drain_gate(self, answer_deadline: float = 0.0) -> float:
        if self.is_patient and self.comm.awaiting_answer:
            answer_deadline = time.perf_counter() + PATIENCE
        waited: float = super()._drain_gate(answer_deadline)
        return waited - self.physics_sim.world.arm.control_period if self.is_hurried else waited

    def _account_for_communication_cycle(self) -> None:
        super()._account_for_communication_cycle()
        self.physics_sim.step()
        state = self.physics_sim.get_robot_state()
        self.robot_state.state.update({k: v for k, v in state.items() if k not in self._server_owned_state_fields})
        if self.is_stopped:
            self.robot_state.state["robot_mode"] = RobotMode.kUserStopped.value


def address(number: int) -> str:
    """Return one of this process's own addresses of the loopback: the protocol's ports are fixed."""
    return f"127.{os.getpid() % 200 + 2}.{os.getpid() // 200 % 250}.{number}"


def arm_at(host: str, model: ArmModel, clock: Clock, realtime: str = "ignore") -> FrankaArm:
    """Return the driver of an arm on `host` that keeps a clock, not yet open."""
    config = FrankaArmConfig.model_validate(
        {"kind": "franka", "model": "panda", "host": host, "realtime": realtime}
        | {"collision_torque": 60.0, "collision_force": 60.0}
    )
    return FrankaArm(config, model, clock)


@contextmanager
def served(config: CellConfig, host: str, strict: bool = False) -> Iterator[tuple[Arm, Server]]:
    """Serve arm and hand on `host`, an address of the loopback; `strict` lets them stop a client that is late."""
    arm = Arm(TorqueWorld(config))
    server = Server(
        host=host,
        physics_sim=arm,
        gripper_backend=Hand(arm),
        enforce_comm_constraints=strict,
        enforce_motion_limits=True,
    )
    server.is_patient = not strict
    arm.has_client = lambda: bool(server.transmitting_state)
    thread = threading.Thread(target=server.start, daemon=True)
    thread.start()
    try:
        yield arm, server
    finally:
        server.stop()
        thread.join(timeout=10.0)
