"""The samples of one second as arrays: the scan fills them, and another thread writes them."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from drivers import frames
from drivers.quantities import FINGER_NAMES, ImpedanceSetpoint, Pose, SwitchState, Vector
from drivers.scene_facts import Sight
from skills.contract import Observation

_XYZ, _POSE = ("x", "y", "z"), ("x", "y", "z", "qw", "qx", "qy", "qz")
COLUMNS: tuple[str, ...] = (
    *("stamp", "stage"),
    *(f"tip_{part}" for part in _XYZ),
    *(f"axis_{part}" for part in _XYZ),
    *("theta", "theta_stamp"),
    *(f"tcp_{part}" for part in _XYZ),
    *(f"force_{part}" for part in _XYZ),
    *(f"setpoint_{part}" for part in _XYZ),
    *("width", "switch", "frame"),
    *(f"true_peg_{part}" for part in _POSE),
    *(f"true_hole_{part}" for part in _POSE),
)
"""Columns in SI units, base frame; `switch` is 1 closed, 0 open, -1 unknown; `frame` is the taxel frame's sequence
number.

No sensor measures the columns that begin with `true_`: a simulated cell records them for pictures, in a physical cell
they are NaN. The origin of the peg's frame is its centre, with z from its end upward. The origin of the hole's frame is
the centre of its mouth, with z outward.
"""
JOINT_COLUMNS = {"joints": "joint", "velocities": "joint_velocity", "torques": "joint_torque"}
"""Lists of joint positions, rad, velocities, rad/s, and commanded torques, N·m. Each is mapped to the prefix of its columns in CSV."""
BATCH = 100
"""Number of rows per write; one second at the usual scan rate."""
_SWITCH = {SwitchState.CLOSED: 1.0, SwitchState.OPEN: 0.0, SwitchState.UNKNOWN: -1.0}
_TRUTH = COLUMNS.index("true_peg_x")
_NO_SETPOINT, _NO_SIGHT = np.full(3, np.nan), np.full(14, np.nan)


@dataclass(slots=True, eq=False)
class SampleBlock:
    """Samples of up to `BATCH` scans."""

    values: Vector = field(default_factory=lambda: np.empty((len(COLUMNS), BATCH)))
    """Values of `COLUMNS`, shape (columns, BATCH)."""
    taxels: list[Vector] = field(default_factory=list)
    """Readings of the taxels at each scan, counts, shape (2 n,)."""
    joints: dict[str, list[list[float]]] = field(default_factory=lambda: {name: [] for name in JOINT_COLUMNS})
    """Values of all joints at each scan, by names of `JOINT_COLUMNS`."""
    used: int = 0
    """Number of scans in the block."""

    @property
    def is_full(self) -> bool:
        """True if the block holds `BATCH` scans."""
        return self.used == BATCH

    def add(self, seen: Observation, setpoint: ImpedanceSetpoint | None, stage: int, sight: Sight | None) -> None:
        """Add one scan, its setpoint, the stage's number, and the true poses of peg and hole."""
        row = self.values[:, self.used]
        row[0], row[1] = seen.stamp, stage
        row[2:5], row[5:8] = seen.tip, seen.axis
        row[8], row[9] = seen.peg.theta, seen.peg.stamp
        row[10:13], row[13:16] = seen.arm.tcp.position, seen.arm.wrench.force
        row[16:19] = _NO_SETPOINT if setpoint is None else setpoint.tip
        row[19], row[20], row[21] = seen.gripper.width, _SWITCH[seen.switch], seen.frame.sequence
        row[_TRUTH : _TRUTH + 14] = _NO_SIGHT if sight is None else (*_seven(sight.peg), *_seven(sight.hole))
        self.taxels.append(seen.frame.values.reshape(-1))
        arm = seen.arm
        torque = np.full_like(arm.q, np.nan) if arm.commanded is None else arm.commanded
        for name, values in zip(JOINT_COLUMNS, (arm.q, arm.dq, torque), strict=True):
            self.joints[name].append(values.tolist())
        self.used += 1


class SampleStream:
    """Collects the scans of one run, and passes on every full block."""

    def __init__(self, write: Callable[[SampleBlock], None]) -> None:
        """Keep the function to call with each full block; a block is not changed afterwards."""
        self._write = write
        self._block = SampleBlock()

    def add(
        self, seen: Observation, setpoint: ImpedanceSetpoint | None, stage: int, sight: Sight | None = None
    ) -> None:
        """Add one scan, its setpoint, the stage's number, and the true poses of peg and hole."""
        self._block.add(seen, setpoint, stage, sight)
        if self._block.is_full:
            self._write(self.rest())

    def rest(self) -> SampleBlock:
        """Return the present block, full or not, and start another."""
        block, self._block = self._block, SampleBlock()
        return block


def taxel_columns(taxels: int) -> list[str]:
    """Return the names of the CSV columns of the readings, counts; `taxels` is the number of taxels of both fingers."""
    return [f"taxel_{finger}_{taxel}" for finger in FINGER_NAMES for taxel in range(taxels // len(FINGER_NAMES))]


def _seven(pose: Pose) -> tuple[float, ...]:
    """Return position and quaternion, wxyz, of a pose."""
    return (*pose.position.tolist(), *frames.quaternion(pose.rotation))
