"""MuJoCo models of the cell; they contain only bodies with contacts.

Two models share the arm. In `held` the peg is attached to the hand by a hinge about the closing axis, as in [gibbons],
Sec. II and Fig. 2, and by two slides in the pads' plane. `sim.hand.slip` computes the pads' force on it. In `free` the peg
is a separate body, in the rack, between the fingers' pads or in the hole. Gravity is off and the peg's weight is an
applied force, because the arm's controller compensates the arm's own weight exactly.
"""

import math
from copy import copy

import mujoco
import numpy as np

from drivers import frames
from drivers.arm.model import Inertial
from drivers.parts import Job
from drivers.quantities import Vector
from sim.arm.arm_truth import ArmTruth
from sim.contact import shapes
from sim.contact import table as contact
from sim.contact.plate import Plate, geoms, words
from sim.hand import slip
from sim.world import native

GRIP = "grip"
"""Name of the body at the finger centre that rotates with the held peg."""
HINGE_RANGE = math.radians(100.0)
"""Range of the hinge's angle, rad; at its end the peg meets the palm and the grasp is lost."""
RACK_CLEARANCE = 0.25e-3
"""Radial clearance of a slot, m."""
PAD_MARGIN = 2e-4
"""Distance below which MuJoCo checks a pad and the peg, m; force needs contact. Without this margin, release 3.17
treats a rare shallow contact of box and cylinder as a peg through the whole box."""
PAD_THICKNESS = 0.004
"""Thickness of the block that represents a finger's rubber, along the closing axis, m; it has no effect on the physics."""
FINGER_ARMATURE = 1.0
"""Inertia of the hand's drive at a finger, kg; not published, of the order of a geared motor's."""
TOLERANCE = 1e-12
"""Tolerance of the solver's cost, which scales with the arm's inertia. At 1e-9 the solution of the light peg is
incomplete and it hops; at 1e-12 its acceleration errs by less than 1e-3 rad/s². A finer line search is not needed
before Newton's next step."""


def held_model(arm: ArmTruth, job: Job, plate: Plate, friction: float, timestep: float) -> mujoco.MjModel:
    """Return the model of the arm with the peg on its hinge and slides, above one plate."""
    axis, hand = -job.peg.length / 2 + job.peg.overhang / 2, arm.model.hand
    # The peg's frame is that of `drivers.frames.peg_in_finger(0)`: x the closing axis, z from the tip to the finger.
    # The hinge rotates about the finger centre. The slides move the peg in its own frame, first along, then across it.
    peg = f"""<body name="{GRIP}" pos="0 0 {hand.finger_centre}" quat="0 {math.sqrt(0.5)} {math.sqrt(0.5)} 0">
      <inertial mass="1e-6" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="pivot" type="hinge" axis="1 0 0" armature="{slip.TURNING_INERTIA}"/>
      <body name="peg"><joint name="along" type="slide" axis="0 0 1" armature="{slip.MASS}"/>
        <joint name="beside" type="slide" axis="0 1 0" armature="{slip.MASS}"/>
        {_peg_geom(job, axis)}</body></body>"""
    hand_mass = hand.body.mass + 2 * hand.finger.mass
    plates = "".join(geoms("plate", plate, friction, timestep))
    return _compile(plates, arm, _arm(arm, timestep, hand_mass, peg), "", 'island="disable"', timestep)


def free_model(
    arm: ArmTruth,
    job: Job,
    plate: Plate,
    rack: Plate,
    friction: float,
    pad_friction: float,
    pad: tuple[float, float],
    timestep: float,
) -> mujoco.MjModel:
    """Return the model of the arm with two moving fingers, pads of length and width `pad`, m, and the peg as a separate body."""
    length, width = pad
    hand = arm.model.hand
    fingers = ""
    for name, sign, finger in (("left", 1, hand.finger), ("right", -1, hand.finger.turned())):
        fingers += f"""<body name="{name}" pos="0 0 {hand.finger_centre}">
          <joint name="{name}" type="slide" axis="0 {sign} 0" limited="true" range="0 {hand.stroke / 2}" armature="{FINGER_ARMATURE}"
            solreflimit="{2 * timestep} 1" solimplimit="0.999 0.999 0.0005"/>
          {_inertial(finger)}
          <geom name="{name}" type="box" size="{width / 2} {PAD_THICKNESS / 2} {length / 2}" pos="0 {sign * PAD_THICKNESS / 2} 0"
            contype="2" conaffinity="0" friction="{pad_friction} 0.002 0.0001" priority="1" solref="{2 * timestep} 1" solimp="0.999 0.999 0.0005"
            margin="{PAD_MARGIN}" gap="{PAD_MARGIN}"/>
        </body>"""
    peg = f"""<body name="peg"><freejoint/>{_peg_geom(job, 0.0)}</body>"""
    plates = "".join(geoms("plate", plate, friction, timestep) + geoms("rack", rack, friction, timestep))
    extra = f'<equality><joint joint1="left" joint2="right" solref="{2 * timestep} 1" solimp="0.999 0.999 0.0005"/></equality>'
    bodies = _arm(arm, timestep, hand.body.mass, fingers) + peg
    return _compile(plates, arm, bodies, extra, 'island="enable"', timestep)


def without_peg(model: mujoco.MjModel, longer: int) -> mujoco.MjModel:
    """Return a twin of the free model without contacts of the peg, with a time step `longer` times as long.

    A peg at rest, without its weight, then stays in place at no computing cost.
    """
    twin = copy(model)
    twin.opt.timestep *= longer
    for solref in (twin.dof_solref, twin.jnt_solref, twin.eq_solref):
        solref[:, 0] *= longer
    twin.geom("peg").conaffinity[:] = 0
    return twin


def _peg_geom(job: Job, axis: float) -> str:
    half = (job.peg.length + job.peg.overhang) / 2
    return (
        f'<geom name="peg" {shapes.peg_geom(job.peg.part, half)} pos="0 0 {axis}" mass="{job.peg.mass}" '
        'contype="0" conaffinity="3" friction="0.01 0.002 0.0001"/>'
    )


def _arm(arm: ArmTruth, timestep: float, hand_mass: float, in_hand: str) -> str:
    dh, joints, hand = arm.model.kinematics, arm.model.joints, arm.model.hand
    inner = f"""<body name="hand" pos="0 0 {dh.flange}" euler="0 0 {hand.turn}">
      {_inertial(hand.body.model_copy(update={"mass": hand_mass}))}
      {_displaced(arm, in_hand)}</body>"""
    for i, link in reversed(list(enumerate(arm.model.link))):
        a, d, alpha = dh.a[i], dh.d[i], dh.alpha[i]
        inner = f"""<body name="link{i + 1}" pos="{a} {-d * math.sin(alpha)} {d * math.cos(alpha)}" euler="{alpha} 0 0">
          {_inertial(link)}
          <joint name="joint{i + 1}" type="hinge" axis="0 0 1" limited="true" range="{joints.q_min[i]} {joints.q_max[i]}"
            armature="{arm.rotor_inertia[i]}" frictionloss="{arm.friction.dry[i]}" solreffriction="{2 * timestep} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/>
          {inner}</body>"""
    return inner


def _displaced(arm: ArmTruth, in_hand: str) -> str:
    """Return the true position of an object in the hand, displaced and rotated about its assumed position."""
    offset, turn = np.array(arm.tcp_offset), np.array(arm.tcp_turn)
    if not offset.any() and not turn.any():
        return in_hand
    centre, R = arm.model.hand.finger_centre * frames.UP, frames.rotation_by(turn)
    place: Vector = centre + offset - R @ centre
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, R.flatten())
    return f'<body pos="{words(place)}" quat="{words(quat)}">{in_hand}</body>'


def _inertial(body: Inertial) -> str:
    """Return a body's inertial element; without products of inertia, as a diagonal, so that MuJoCo keeps the axes."""
    main, products = body.inertia[:3], body.inertia[3:]
    inertia = f'fullinertia="{words(body.inertia)}"' if any(products) else f'diaginertia="{words(main)}"'
    return f'<inertial mass="{body.mass}" pos="{words(body.com)}" {inertia}/>'


def _compile(plates: str, arm: ArmTruth, bodies: str, extra: str, options: str, timestep: float) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco model="cell">
        <compiler angle="radian" autolimits="false" fusestatic="true"/>
        <option timestep="{timestep}" gravity="0 0 0" cone="elliptic" impratio="10" solver="Newton" iterations="60" tolerance="{TOLERANCE}" ls_tolerance="0.1" jacobian="dense">
          <flag {options} autoreset="disable"/></option>
        <size nuser_geom="{contact.USER}" nuserdata="{native.NUSERDATA}" memory="4M"/>
        <worldbody>{plates}{bodies}</worldbody>{extra}</mujoco>"""
    )
