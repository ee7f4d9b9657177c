"""Calibration of the arm: each joint moves slowly to and fro in free space, then all joints together.

The arm moves through the same contract as in a skill: joint paths give one setpoint at the tool centre point per scan,
through the gate and the limits. The torque of a joint beyond the arm's model comes from the law's momentum observer,
`ArmState.unexplained`.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date

import numpy as np

from cell.calibrate.joint_fit import JointFit, Pass, fit
from cell.config.cell_config import CellConfig
from cell.devices.assembly import assemble, opened
from drivers import impedance
from drivers.arm.calibration import ArmCalibration, Measured, implausible
from drivers.arm.kinematics import jacobian, joints_at
from drivers.arm.model import JOINTS, ArmModel
from drivers.errors import CellError, ConfigError, NotCalibratedError
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, Pose, Twist, Vector
from skills.catalogue import GRASP
from skills.contract import Interrupted, Observation, SkillContext
from skills.grasp_from_rack import ACROSS_RACK
from skills.guards.clearance import Attitude, require_clear
from skills.motion import VALIDITY, Goal, move
from skills.pace import at_pace

REACH = 0.2
"""Largest joint displacement from the start, rad."""
RUN_UP = 0.2
"""Time of acceleration and of deceleration of a pass, s."""
SETTLED = 0.5
"""Time from the end of the run-up to the first evaluated torque, s; in it, overshoot of speed and rotor torque decay."""
INSIDE = 0.02
"""Margin to the edge of the workspace, m, and to the joints' limits, rad."""
AWAKE = 0.5
"""Least ratio of measured to commanded speed in a pass, fraction; a slower joint is blocked."""


@dataclass(frozen=True, slots=True)
class JointSweep:
    """Parameters of the joint motions."""

    speeds: tuple[float, ...] = (0.06, 0.15, 0.35)
    """Speeds of the passes, rad/s: as in slow corrections, in a search, and in a transfer."""
    even: float = 1.2
    """Time of the constant-speed part of a pass, s, if the joint's range permits it."""
    together: float = 12.0
    """Duration of the motion of all joints, s."""


def calibrate_arm(
    config: CellConfig, today: date, done: Callable[[int, int], None], sweep: JointSweep = JointSweep()
) -> ArmCalibration:
    """Move every joint and return the arm's calibration; in any case, bring the arm to rest.

    Args:
        config: Config of the cell; its own calibration is not used.
        today: Date of the calibration.
        done: Function called with the number of motions done and of all.
        sweep: Parameters of the joint motions.

    Raises:
        NotCalibratedError: The arm had contact, a joint did not move, or the figures are impossible for an arm.
        CellError: A device cannot be opened, times out, is stopped, or does not follow its setpoint.
    """
    arm, passes = config.arm_model(), []
    with opened(assemble(_alone(config))) as cell:
        ctx = cell.context(0)
        ctx.stage = "calibrate arm"
        try:
            _require_empty(ctx)
            motion = JointMotion(config, ctx, _go_to_middle(config, ctx))
            for joint in range(JOINTS):
                done(joint, JOINTS + 1)
                passes.append(motion.to_and_fro(joint, sweep))
            together = motion.all_together(sweep.together)
            done(JOINTS + 1, JOINTS + 1)
        except Interrupted as interruption:
            raise NotCalibratedError(
                f"calibrate arm: {interruption.reason.name} although the arm should touch nothing: limits.force = "
                f"{config.limits.force:g} N; check what the arm touches, and its payload"
            ) from None
        finally:
            with suppress(CellError):
                ctx.lead.rest.wait(ctx.devices.clock, ctx.schedule.period)
    found = _calibration(
        [fit(each, sweep.speeds) for each in passes], together, sweep.speeds, arm, config.arm_unit(), today
    )
    if (why := implausible(found, arm)) is not None:
        raise NotCalibratedError(f"calibrate arm: {why}: check what the arm touches, its payload and its brakes")
    return found


def _alone(config: CellConfig) -> CellConfig:
    """Return the config without the arm's calibration; a simulation runs at the fastest pace."""
    changes: dict[str, object] = {"calibration": config.calibration.model_copy(update={"arm": None})}
    if config.is_simulated and config.sim is not None:
        changes["sim"] = config.sim.model_copy(update={"pace": "max"})
    return config.model_copy(update=changes)


def _require_empty(ctx: SkillContext) -> None:
    if ctx.observe().gripper.is_gripping:
        raise NotCalibratedError("calibrate arm: the hand holds something; empty fingers needed: `cell run recover`")


def _go_to_middle(config: CellConfig, ctx: SkillContext) -> Vector:
    """Move to a point above the middle between rack and plate; return the joint positions, shape (7,), rad."""
    transfer = at_pace(config.params(GRASP).transfer, config.pace())
    low, high = np.array(config.limits.low), np.array(config.limits.high)
    between = 0.5 * (np.array(config.hole.centre) + np.array(config.rack.first))
    # Height of the fingers over rack and plate, m.
    between[2] = max(config.hole.centre[2], config.rack.first[2]) + 0.25
    place = np.clip(between, low + REACH, high - REACH)
    if joints_at(config.arm_model(), place, UP, ACROSS_RACK, 0.0, transfer.elbow) is None:
        raise ConfigError(
            f"calibrate arm: the arm does not reach {place.round(3).tolist()}; see rack.first and hole.centre"
        )
    hand = ctx.observe().arm.tcp
    risen = np.array([*hand.position[:2], max(place[2], hand.position[2])])
    for goal in (Goal(risen, -hand.rotation[:, 0], hand.rotation[:, 2]), Goal(place, UP, ACROSS_RACK)):
        for _ in move(goal, transfer, ctx, None, settle=0.5):
            pass
    ctx.wrench.set_zero()
    return ctx.observe().arm.q


class JointMotion:
    """Motions of single joints and of all of them from one posture."""

    def __init__(self, config: CellConfig, ctx: SkillContext, start: Vector) -> None:
        """Keep the cell; `start` are the joint positions before and after each motion, shape (7,), rad."""
        self._ctx, self._start, self._limits = ctx, start, config.limits
        self._transfer, self._joints = config.params(GRASP).transfer, config.arm_model().joints
        self._figures = impedance.figures(config.arm_model())

    def to_and_fro(self, joint: int, sweep: JointSweep) -> list[Pass]:
        """Move a joint to and fro at every speed, and return the means of the passes."""
        passes, reach = [], self._reach(joint)
        for speed in sweep.speeds:
            half = min(reach, 0.5 * speed * (sweep.even + RUN_UP + SETTLED))
            ends = self._start.copy(), self._start.copy()
            ends[0][joint] -= half
            ends[1][joint] += half
            self._even_part(self._start, ends[0], speed)
            # Two passes in each direction: the fit computes the interval from their scatter.
            passes += [self._pass(ends[k % 2], ends[1 - k % 2], joint, speed) for k in range(4)]
            self._even_part(ends[0], self._start, speed)
        return passes

    def all_together(self, duration: float) -> list[Observation]:
        """Move all joints together for `duration`, s, and return the scans."""
        # Angular rates, rad/s; they differ, so that every combination of directions occurs.
        rates = np.array((1.0, 1.3, 1.7, 1.1, 1.9, 1.5, 2.1))

        def path(time: float) -> tuple[Vector, Vector]:
            # The amplitude grows and decays, so that the motion starts and ends at rest.
            swing = 0.07  # Amplitude of each joint in the motion of all joints, rad.
            grown = swing * math.sin(math.pi * time / duration) ** 2
            growth = swing * math.pi / duration * math.sin(2.0 * math.pi * time / duration)
            turned = rates * time
            return self._start + grown * np.sin(turned), growth * np.sin(turned) + grown * rates * np.cos(turned)

        return list(self._follow(path, duration))

    def _pass(self, at: Vector, to: Vector, joint: int, speed: float) -> Pass:
        """Move a joint in one pass, and return the mean of the constant-speed part.

        Raises:
            NotCalibratedError: The joint was slower than `AWAKE` of its commanded speed.
        """
        scans = self._even_part(at, to, speed)
        sense = math.copysign(1.0, float(to[joint] - at[joint]))
        rate = float(np.mean([seen.arm.dq[joint] for seen in scans]))
        if not sense * rate >= AWAKE * speed:
            raise NotCalibratedError(
                f"calibrate arm: joint {joint + 1} moved at {sense * rate:.3f} rad/s instead of {speed:g}; at least {AWAKE * speed:g}"
                " needed: something holds it, or its friction is too high for the gains of grasp.transfer"
            )
        drift = float(np.polyfit([seen.elapsed for seen in scans], [seen.arm.dq[joint] for seen in scans], 1)[0])
        return Pass(sense * speed, rate, float(np.mean([_unexplained(seen)[joint] for seen in scans])), drift)

    def _even_part(self, at: Vector, to: Vector, speed: float) -> list[Observation]:
        """Move the joints on a straight line in joint space, and return the scans of the constant-speed part."""
        way = to - at
        duration = float(np.abs(way).max()) / speed + RUN_UP

        def path(time: float) -> tuple[Vector, Vector]:
            share, rate = _even(time, duration)
            return at + share * way, rate * way

        scans = self._follow(path, duration)
        return [seen for seen in scans if RUN_UP + SETTLED <= seen.elapsed <= duration - RUN_UP]

    def _follow(self, path: Callable[[float], tuple[Vector, Vector]], duration: float) -> Iterator[Observation]:
        """Move the joints along a path, and yield every scan.

        Args:
            path: Function that returns joint positions, rad, and velocities, rad/s, shape (7,) each, at a time, s.
            duration: Time of the path, s.
        """
        ctx, transfer = self._ctx, self._transfer
        places = [self._hand(path(time)[0])[0] for time in np.linspace(0.0, duration, 25)]
        way = [Attitude(place.position, -place.rotation[:, 0], place.rotation[:, 2]) for place in places]
        require_clear(way, ctx.job, None, transfer.clearance)
        identity, stiffness, damping = ctx.new_id(), transfer.gains.stiffness(), transfer.gains.damping_ratios()
        for seen in ctx.scan(10.0 * duration):
            if seen.elapsed >= duration:
                return
            q, dq = path(seen.elapsed)
            hand, J = self._hand(q)
            twist = J @ dq
            ctx.follow(
                ImpedanceSetpoint(
                    id=identity,
                    tip=hand.position,
                    axis=-hand.rotation[:, 0],
                    roll=hand.rotation[:, 2],
                    stiffness=stiffness,
                    damping_ratio=damping,
                    valid_until=seen.stamp + VALIDITY,
                    # The law damps the velocity in the null space, not its deviation from the path, so that the posture
                    # lags. The commanded posture leads the path by NULL_DAMPING / NULL_STIFFNESS, s, to compensate this.
                    posture=q + (impedance.NULL_DAMPING / impedance.NULL_STIFFNESS) * dq,
                    is_free=True,
                    twist=Twist(twist[:3], twist[3:]),
                )
            )
            yield seen

    def _hand(self, q: Vector) -> tuple[Pose, Vector]:
        """Return T_base_tcp and its Jacobian, shape (6, 7), base frame, at joint positions, rad."""
        position, rotation, axes, origins = impedance.forward(self._figures, q)
        return Pose(position, rotation), jacobian(position, axes, origins)

    def _reach(self, joint: int) -> float:
        """Return the largest displacement of a joint to both sides, within its range and with the hand in the workspace, rad.

        Raises:
            ConfigError: The displacement is too small for a calibration.
        """
        least_reach = 0.5  # Least permitted displacement in a small workspace, as a fraction of `REACH`.
        limits, joints = self._limits, self._joints
        low, high = np.array(limits.low) + INSIDE, np.array(limits.high) - INSIDE
        for share in np.linspace(1.0, least_reach, 6):
            reach, is_inside = REACH * float(share), True
            for sense in (-1.0, 1.0):
                q = self._start.copy()
                q[joint] += sense * reach
                is_inside &= joints.q_min[joint] + INSIDE <= q[joint] <= joints.q_max[joint] - INSIDE
                place = self._hand(q)[0].position
                is_inside &= bool(np.all(place >= low) and np.all(place <= high))
            if is_inside:
                return reach
        raise ConfigError(
            f"calibrate arm: joint {joint + 1} cannot move by {least_reach * REACH:.3f} rad to both sides within limits.low ="
            f" {list(limits.low)} and limits.high = {list(limits.high)}: a wider workspace needed"
        )


def _even(time: float, duration: float) -> tuple[float, float]:
    """Return position and rate, relative to the whole distance, of a trapezoidal speed profile."""
    most = 1.0 / (duration - RUN_UP)
    t = min(max(time, 0.0), duration)
    if t < RUN_UP:
        return 0.5 * most * t * t / RUN_UP, most * t / RUN_UP
    left = duration - t
    if left < RUN_UP:
        return 1.0 - 0.5 * most * left * left / RUN_UP, most * left / RUN_UP
    return most * (t - 0.5 * RUN_UP), most


def _unexplained(seen: Observation) -> Vector:
    torque = seen.arm.unexplained
    if torque is None:
        raise NotCalibratedError("calibrate arm: this arm does not report the torques of its joints")
    return torque


def _calibration(
    fits: Sequence[JointFit],
    together: Sequence[Observation],
    speeds: tuple[float, ...],
    arm: ArmModel,
    unit: str,
    today: date,
) -> ArmCalibration:
    def measured(pairs: Sequence[tuple[float, float]]) -> Measured:
        values, intervals = zip(*pairs, strict=True)
        return Measured(value=values, interval=intervals)

    found = ArmCalibration(
        date=today,
        arm=arm.name,
        unit=unit,
        speeds=speeds,
        friction=tuple(measured([each.friction[k] for each in fits]) for k in range(len(speeds))),
        offset=measured([each.offset for each in fits]),
        dry=measured([each.dry for each in fits]),
        smooth=measured([each.smooth for each in fits]),
        unexplained=(0.0,) * JOINTS,
    )
    dq, torque = np.array([seen.arm.dq for seen in together]), np.array([_unexplained(seen) for seen in together])
    # Joint velocity above which the torque is compared with the figures, rad/s.
    left = np.where(np.abs(dq) > 0.03, torque - found.predicted(dq), np.nan)
    rms = np.sqrt(np.nanmean(left**2, axis=0))
    return found.model_copy(update={"unexplained": tuple(float(x) for x in rms)})
