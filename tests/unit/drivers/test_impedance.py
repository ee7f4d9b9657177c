"""The law of the arm."""

import math

import numpy as np
import pytest

from cell.config.files import arm_file
from drivers import impedance, setpoint_words
from drivers.arm import dynamics, learning
from drivers.arm.inertia import joint_inertia
from drivers.arm.link import holding_words
from drivers.arm.model import read_arm
from drivers.quantities import ImpedanceSetpoint, InHandTip, Twist, Vector
from skills.motion import Transfer

Q: Vector = np.array([0.1, -0.5, 0.2, -2.2, 0.1, 1.8, 0.9])
PANDA = read_arm(arm_file("panda"))
ARM = impedance.figures(PANDA)
PERIOD = PANDA.control_period


def setpoint(tip: Vector, axis: Vector, **more: object) -> ImpedanceSetpoint:
    return ImpedanceSetpoint(
        id=1,
        tip=tip,
        axis=axis,
        stiffness=np.array([500.0] * 3 + [20.0] * 3),
        damping_ratio=np.ones(6),
        valid_until=10.0,
        **more,  # type: ignore[arg-type]
    )


def tip_of(q: Vector, theta: float, length: float) -> tuple[Vector, Vector]:
    position, finger, _, _ = impedance.forward(ARM, q)
    axis = -(math.cos(theta) * finger[:, 0] + math.sin(theta) * finger[:, 1])
    return position - length * axis, axis


def jacobian(q: Vector, theta: float, length: float) -> Vector:
    """Return the Jacobian of tip and finger by differences, shape (6, 7)."""
    h, rows = 1e-6, []
    for i in range(7):
        step = np.zeros(7)
        step[i] = h
        moved = (tip_of(q + step, theta, length)[0] - tip_of(q - step, theta, length)[0]) / (2 * h)
        R0, R1 = impedance.forward(ARM, q - step)[1], impedance.forward(ARM, q + step)[1]
        W = (R1 - R0) / (2 * h) @ impedance.forward(ARM, q)[1].T
        rows.append([*moved, W[2, 1], W[0, 2], W[1, 0]])
    return np.array(rows).T


def settled(words: Vector, q: Vector, dq: Vector, now: float = 0.0, law: Vector | None = None) -> Vector:
    """Return the torque after 200 cycles, when the rate limit has no effect any more; the integral is off."""
    state = np.zeros(impedance.STATE_WORDS) if law is None else law
    for _ in range(200):
        tau: Vector = impedance.torque(ARM, words, state, q, dq, now, PERIOD)
    return tau


@pytest.mark.parametrize("theta", [0.0, 0.3])
@pytest.mark.parametrize(
    ("pull", "turn"), [((0.0, 0.0, 0.0), 0.0), ((0.004, -0.002, 0.003), 0.0), ((0.0, 0.0, 0.0), 0.1)]
)
def test_springs_pull_the_tip_and_turn_the_axis_to_the_setpoint(theta, pull, turn) -> None:
    """As printed, v x v* with -K e would turn it away."""
    tip, axis = tip_of(Q, theta, 0.05)
    normal = np.cross(axis, [0.0, 1.0, 0.0])
    normal /= np.linalg.norm(normal)
    wanted = axis * math.cos(turn) + np.cross(normal, axis) * math.sin(turn)
    words = setpoint_words.pack(setpoint(tip + np.array(pull), wanted, in_hand=InHandTip(theta, 0.05)), 0.0)
    expected = jacobian(Q, theta, 0.05).T @ np.array([*(500.0 * np.array(pull)), *(20.0 * turn * normal)])
    np.testing.assert_allclose(settled(words, Q, np.zeros(7)), expected, atol=1e-3)


def test_no_torque_exceeds_the_rate_and_level_of_the_arm() -> None:
    tip, axis = tip_of(Q, 0.0, 0.05)
    words = setpoint_words.pack(setpoint(tip + 0.5, axis), 0.0)
    tau = impedance.torque(ARM, words, np.zeros(impedance.STATE_WORDS), Q, np.zeros(7), 0.0, PERIOD)
    assert np.abs(tau).max() <= PANDA.joints.torque_rate[0] * PERIOD * (1.0 + 1e-12)
    assert (np.abs(settled(words, Q, np.zeros(7))) <= np.array(PANDA.joints.torque)).all()


def test_a_setpoint_past_its_validity_is_replaced_by_holding_still() -> None:
    tip, axis = tip_of(Q, 0.0, 0.05)
    words = setpoint_words.pack(setpoint(tip + 0.1, axis, in_hand=InHandTip(0.0, 0.05)), 0.0)
    np.testing.assert_allclose(settled(words, Q, np.zeros(7), now=11.0), 0.0, atol=1e-3)


def held_torque(q: Vector, dq: Vector, law: Vector | None = None) -> Vector:
    """Return the settled torque of an arm that began to hold still at `Q`."""
    state = impedance.new_state(PANDA) if law is None else law
    impedance.torque(ARM, holding_words(), state, Q, np.zeros(7), 0.0, PERIOD)
    return settled(holding_words(), q, dq, law=state)


def test_a_holding_arm_is_drawn_back_and_damped_alike_everywhere() -> None:
    """The inertia is that of where it began."""
    dq = np.array([0.02, -0.03, 0.01, 0.04, -0.02, 0.05, 0.03])
    away = 1e-3 * np.array([1.0, -2.0, 0.5, 1.5, -1.0, 2.0, 3.0])
    rate, inertia = impedance.HOLD_RATE, joint_inertia(PANDA, Q) + np.diag(PANDA.joints.rotor_inertia)
    np.testing.assert_allclose(held_torque(Q, dq), -2.0 * rate * inertia @ dq, rtol=1e-9)
    np.testing.assert_allclose(held_torque(Q + away, np.zeros(7)), -(rate**2) * inertia @ away, rtol=1e-9)


@pytest.mark.parametrize(
    ("learnt", "deviation", "rotor"), [(0.06, 0.02, 0.04), (0.06, 0.08, 0.0), (-0.06, 0.02, 0.0), (9.0, 0.02, 0.1)]
)
def test_a_holding_arm_uses_learnt_rotors_less_their_deviation(learnt: float, deviation: float, rotor: float) -> None:
    """No more than five times the least that may show: 0.125 kg·m² in the wrist, where 0.025 is the model's."""
    figures, deviations = np.zeros((7, learning.FIGURES)), learning.doubts(PANDA)
    figures[6, learning.ROTOR], deviations[6, learning.ROTOR] = learnt, deviation
    dq = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1])
    more = held_torque(Q, dq, impedance.new_state(PANDA, (figures, deviations))) - held_torque(Q, dq)
    np.testing.assert_allclose(more, -2.0 * impedance.HOLD_RATE * rotor * dq, atol=1e-9)


def coriolis(q: Vector, dq: Vector) -> Vector:
    """Return the Coriolis torques by differences of the mass matrix, shape (7,), N·m."""
    # c = dM/dt dq - ½ ∂(dqᵀ M dq)/∂q.
    h = 1e-5
    change = [joint_inertia(PANDA, q + h * way) - joint_inertia(PANDA, q - h * way) for way in (dq, *np.eye(7))]
    torques: Vector = (change[0] @ dq - [0.5 * dq @ each @ dq for each in change[1:]]) / (2.0 * h)
    return torques


def test_omitted_coriolis_torques_are_small_at_transfer_speed() -> None:
    rng, torque, force = np.random.default_rng(1), 0.0, 0.0
    for _ in range(20):
        q, way = Q + rng.uniform(-0.5, 0.5, 7), rng.normal(size=3)
        J = jacobian(q, 0.0, 0.05)
        twist = np.append(Transfer().speed * way / np.linalg.norm(way), np.zeros(3))
        omitted = coriolis(q, np.linalg.pinv(J) @ twist)
        torque = max(torque, float(np.abs(omitted).max()))
        force = max(force, float(np.linalg.norm((np.linalg.pinv(J.T) @ omitted)[:3])))
    assert 0.3 < torque < 0.6
    assert 1.0 < force < 2.0


def test_a_halt_anew_holds_where_the_arm_is_then() -> None:
    state, moved = impedance.new_state(PANDA), Q + 0.01
    held_torque(moved, np.zeros(7), state)
    state[impedance.IS_HOLDING] = 0.0
    np.testing.assert_allclose(settled(holding_words(), moved, np.zeros(7), law=state), 0.0, atol=1e-12)


def test_the_integral_is_saturated_and_a_new_id_empties_it() -> None:
    tip, axis = tip_of(Q, 0.0, 0.05)
    leaning = axis + np.array([0.2, 0.0, 0.0])
    given = setpoint(tip, leaning / np.linalg.norm(leaning), integral_gain=100.0, integral_limit=0.5)
    words, state = setpoint_words.pack(given, 0.0), np.zeros(impedance.STATE_WORDS)
    for _ in range(2000):
        impedance.torque(ARM, words, state, Q, np.zeros(7), 0.0, PERIOD)
    assert np.abs(state[impedance.INTEGRAL : impedance.INTEGRAL + 3]).max() == pytest.approx(0.5)
    words[setpoint_words.ID] = 2
    words[setpoint_words.INTEGRAL_GAIN] = 0.0
    impedance.torque(ARM, words, state, Q, np.zeros(7), 0.0, PERIOD)
    np.testing.assert_array_equal(state[impedance.INTEGRAL : impedance.INTEGRAL + 3], 0.0)


def test_every_part_of_a_setpoint_reaches_the_torque_loop_in_its_own_words():
    given = setpoint(
        np.array([1.0, 2.0, 3.0]),
        np.array([4.0, 5.0, 6.0]),
        in_hand=InHandTip(20.0, 21.0),
        roll=np.array([7.0, 8.0, 9.0]),
        twist=Twist(np.array([10.0, 11.0, 12.0]), np.array([13.0, 14.0, 15.0])),
        integral_gain=16.0,
        integral_limit=17.0,
        is_free=True,
        posture=np.arange(30.0, 37.0),
    )
    words = setpoint_words.pack(given, 18.0)
    gains = [500.0] * 3 + [20.0] * 3
    assert words.tolist() == [
        *(1, 1, 2, 3, 4, 5, 6, *gains, *[1.0] * 6, 10.0),
        *(1, 20, 21, 1, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17),
        *(1, 30, 31, 32, 33, 34, 35, 36, 18, 1),
    ]
    words = setpoint_words.pack(setpoint(np.ones(3), np.ones(3)), 0.5)  # what is left out is marked so
    flags = [setpoint_words.HAS_HAND, setpoint_words.HAS_ROLL, setpoint_words.HAS_POSTURE, setpoint_words.IS_FREE]
    assert words[flags].tolist() == [0.0] * 4
    assert words[setpoint_words.TWIST : setpoint_words.TWIST + 6].tolist() == [0.0] * 6


def test_the_hand_hangs_where_the_arm_s_tables_put_it():
    """With all joints at zero a Panda's flange lies 88 mm before and 926 mm above its base, and everything below it hangs down."""
    arm = impedance.figures(PANDA)
    position, finger, _, _ = impedance.forward(arm, np.zeros(7))
    assert position == pytest.approx([0.088, 0.0, 0.926 - PANDA.hand.finger_centre])
    assert finger[:, 0] == pytest.approx([0.0, 0.0, -1.0])
    assert arm[impedance.TORQUE_MAX : impedance.TORQUE_MAX + 7].tolist() == [87.0] * 4 + [12.0] * 3
    assert arm[impedance.MASSES : impedance.MOST_LEARNT].tolist() == dynamics.masses(PANDA).tolist()


def test_a_new_state_has_learnt_nothing_and_a_restart_keeps_what_was_learnt():
    state = impedance.new_state(PANDA)
    known = state[impedance.LEARNING :]
    blank = np.zeros_like(known)
    learning.begin(blank, PANDA)
    assert known.tolist() == blank.tolist()
    state[: impedance.LEARNING] = 3.0
    known[:] = 0.25
    kept = known.copy()
    learning.pause(kept)
    impedance.restart(state)
    assert state[: impedance.LEARNING].tolist() == [0.0] * impedance.LEARNING
    assert known.tolist() == kept.tolist()
