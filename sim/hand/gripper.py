"""The simulated hand as a Gripper."""

from drivers.quantities import GripperState
from sim.world import engine
from sim.world.physics import World


class SimGripper:
    """Two fingers moved by one drive."""

    def __init__(self, world: World) -> None:
        """Attach to the physics of the cell with the hand."""
        self._world = world

    def open(self) -> None:
        """Do nothing: there is no connection."""

    def close(self) -> None:
        """Keep the grip, because an opening hand would drop the peg."""

    def grip(self, force: float) -> None:
        """Close until the force reaches `force`, N, or the fingers meet."""
        self._world.control.drive[engine.DRIVE_FORCE] = force * self._world.draw.grip_force

    def release(self, width: float) -> None:
        """Open to `width`, m."""
        self._world.control.drive[engine.DRIVE_FORCE] = 0.0
        self._world.control.drive[engine.DRIVE_WIDTH] = width

    def read(self) -> GripperState:
        """Return the newest state."""
        position_tolerance = 1e-3  # Distance from the commanded width within which the hand reports arrival, m.
        world = self._world
        drive, width = world.control.drive, world.finger_gap()
        force = float(drive[engine.DRIVE_FORCE])
        # Share of the commanded force that must act on both pads before the hand reports a grip, fraction.
        is_gripping = force > 0.0 and world.pad_force() > 0.5 * force
        if force > 0.0:
            is_moving = not is_gripping and width > position_tolerance
        else:
            is_moving = abs(width - float(drive[engine.DRIVE_WIDTH])) > position_tolerance
        return GripperState(width=width, is_gripping=is_gripping, is_moving=is_moving)
