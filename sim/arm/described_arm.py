"""An arm from an external description, read by MuJoCo; it replaces the cell's own arm in the models of a trial.

A description is a URDF or MJCF file. MuJoCo reads and compiles it. Shapes, actuators and all bodies behind the flange
are omitted, because hand, pads and contacts stay those of the cell. Properties without a description stay as drawn:
noise, the torque path, and rotors if the file has none. Decision 0006 lists the source of each property.
"""

import hashlib
import math
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from drivers import frames
from drivers.arm.kinematics import links
from drivers.arm.model import JOINTS, ArmModel
from drivers.errors import ConfigError
from drivers.quantities import Pose, Vector
from sim.arm.arm_truth import ArmTruth, JointFriction, Seven
from sim.config import DescribedArmConfig

GRAVITY = 9.81
FLANGES = ("attachment_site", "link8", "fr3_link8", "panda_link8", "right_hand", "flange")
"""Names of flanges in public descriptions, the most common first."""
QUARTER = math.pi / 4
"""Step of the flange's rotation about z that is undone, rad; descriptions rotate the flange to the mounting of the
hand."""
FARTHEST, LARGEST_TURN = 0.02, math.radians(3.0)
"""Largest distance, m, and angle, rad, between the described and the assumed flange at the cell's home. Beyond them,
zeros, signs or base of the joints differ from the cell's, and trials are meaningless."""
COUNTERWEIGHT = 1e-6
"""Mass of the bodies that carry the cell's gravity compensation, kg."""
_FLANGE = "flange of the cell"


@dataclass(frozen=True, slots=True, eq=False)
class DescribedArm:
    """Seven links of a file, each in the frame of its body."""

    name: str
    """Name of the file."""
    digest: str
    """SHA-256 of the file, hex."""
    flange: str
    """Name of the flange's body or site."""
    turn: float
    """Rotation of that frame about its z that was undone, rad, a multiple of 45 degrees."""
    model: mujoco.MjModel
    """The arm alone, without shapes and without a hand."""
    data: mujoco.MjData
    """State of that model, for kinematics and dynamics queries."""
    takes: tuple[str, ...]
    """Properties that a trial takes from the description, see `DescribedArmConfig`."""

    def pose_of_flange(self, q: Vector) -> Pose:
        """Return the pose of the flange at joint positions, shape (7,), rad, from MuJoCo: T_base_flange."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        return Pose(self.data.site(_FLANGE).xpos.copy(), self.data.site(_FLANGE).xmat.reshape(3, 3).copy())

    def inertia(self, q: Vector) -> tuple[Vector, Vector]:
        """Return MuJoCo's dynamics of the links at rest, for joint positions of shape (7,), rad.

        Returns:
            The mass matrix without rotors, shape (7, 7), kg·m², and the torques that hold the links against gravity,
            shape (7,), N·m.
        """
        self.data.qpos[:] = q
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        M = np.empty((JOINTS, JOINTS))
        mujoco.mj_fullM(self.model, self.data, M)
        return M - np.diag(self.model.dof_armature), self.data.qfrc_bias.copy()

    def tcp(self, arm: ArmModel, q: Vector) -> Pose:
        """Return T_base_tcp, the finger frame of the cell's hand on this arm."""
        flange = self.pose_of_flange(q)
        hand = flange.rotation @ frames.rotation_about(frames.UP, arm.hand.turn)
        centre = flange.position + arm.hand.finger_centre * hand[:, 2]
        return Pose(centre, np.column_stack([hand[:, 2], hand[:, 0], hand[:, 1]]))

    def true(self, drawn: ArmTruth, level: Vector) -> ArmTruth:
        """Return the arm of a trial: the drawn arm with the properties taken from the description.

        Args:
            drawn: The arm as drawn from the cell's own figures.
            level: Drawn factor of each joint's friction, shape (7,).
        """
        friction, rotors = drawn.friction, drawn.rotor_inertia
        if "friction" in self.takes:
            dry, viscous = _seven(self.model.dof_frictionloss * level), _seven(self.model.dof_damping * level)
            friction = JointFriction(dry=dry, viscous=viscous)
        if "rotors" in self.takes and self.model.dof_armature.any():
            rotors = _seven(self.model.dof_armature)
        return replace(drawn, friction=friction, rotor_inertia=rotors, described=self)


def read(config: DescribedArmConfig, arm: ArmModel) -> DescribedArm:
    """Return the arm described by a file, ready for the cell's hand.

    Raises:
        ConfigError: The file is unreadable, has another digest, is not one chain of seven hinges, has no flange of that
            name, or differs from the assumed flange pose; one line with the file, the value found and the allowed
            values.
    """
    path = config.file
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    if config.sha256 not in ("", digest):
        raise ConfigError(f"{path}: its SHA-256 is {digest}; {config.sha256} of sim.described.sha256 allowed")
    model, flange, turn = _bare_arm(path, config.flange, arm)
    found = DescribedArm(path.name, digest, flange, turn, model, mujoco.MjData(model), config.takes)
    away, angle = apart(found.pose_of_flange(np.array(arm.home)), _believed_flange(arm, np.array(arm.home)))
    if away > FARTHEST or angle > LARGEST_TURN:
        raise ConfigError(
            f"{path}: flange {flange!r} lies {1000 * away:.0f} mm and {math.degrees(angle):.0f} degrees from where {arm.name} has it"
            f" at its home; {1000 * FARTHEST:.0f} mm and {math.degrees(LARGEST_TURN):.0f} degrees allowed: same base, zeros, signs and flange needed"
        )
    return found


def apart(one: Pose, other: Pose) -> tuple[float, float]:
    """Return distance, m, and angle, rad, between two poses."""
    turn = one.rotation.T @ other.rotation
    sine = 0.5 * math.hypot(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    return float(np.linalg.norm(one.position - other.position)), math.atan2(sine, 0.5 * (float(np.trace(turn)) - 1.0))


def put_on(model: mujoco.MjModel, truth: ArmTruth) -> None:
    """Write the properties from the description into a compiled model of the cell; its bodies must not be fused.

    Args:
        model: Model of the scene, with the bodies `link1` to `link7` and `hand` of `sim.world.scene`; changed.
        truth: The arm of the trial, with a description.
    """
    described, arm = truth.described, truth.model
    assert described is not None
    theirs, takes = described.model, described.takes
    is_tree, is_mass = "kinematics" in takes, "inertia" in takes
    for i, (R, at) in enumerate(_relative(described, arm)):
        body, own = model.body(f"link{i + 1}").id, int(theirs.jnt_bodyid[i])
        if is_tree:
            joint = model.joint(f"joint{i + 1}").id
            model.body_pos[body], model.body_quat[body] = theirs.body_pos[own], theirs.body_quat[own]
            model.jnt_pos[joint], model.jnt_axis[joint] = theirs.jnt_pos[i], theirs.jnt_axis[i]
            model.jnt_range[joint] = theirs.jnt_range[i]
        # Pose of our link in the frame of the described link; the inverse if our kinematic tree stays.
        way = (R.T, -R.T @ at) if is_tree else (R, at)
        if is_mass:
            model.body_mass[body], model.body_inertia[body] = theirs.body_mass[own], theirs.body_inertia[own]
            model.body_ipos[body], model.body_iquat[body] = theirs.body_ipos[own], theirs.body_iquat[own]
        if is_mass != is_tree:
            _move(model.body_ipos, model.body_iquat, body, *way)
        model.body_sameframe[body] = 0
        if "gravity" in takes and is_tree:
            weight = model.body(f"believed{i + 1}").id
            model.body_pos[weight] = way[0] @ model.body_pos[weight] + way[1]
    if is_tree:
        _mount(model, theirs, arm)
    if "gravity" in takes:
        _weigh(model)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def left_over(model: mujoco.MjModel, scratch: mujoco.MjData, qpos: Vector) -> Vector:
    """Return the residual joint torques after the cell's gravity compensation, shape (7,), N·m.

    Args:
        model: Model of the scene.
        scratch: A separate state of that model, without velocity.
        qpos: Positions of the model.
    """
    bias = np.empty(model.nv)
    scratch.qpos[:] = qpos
    mujoco.mj_kinematics(model, scratch)
    mujoco.mj_comPos(model, scratch)
    mujoco.mj_comVel(model, scratch)
    mujoco.mj_passive(model, scratch)
    mujoco.mj_rne(model, scratch, 0, bias)
    rest: Vector = scratch.qfrc_gravcomp[:JOINTS] - bias[:JOINTS]
    return rest


def believed_weight(index: int, arm: ArmModel) -> str:
    """Return the body that carries the cell's compensation of one link's weight, as MJCF, in the frame of that link."""
    link = arm.link[index]
    x, y, z = link.com
    return (
        f'<body name="believed{index + 1}" pos="{x} {y} {z}" gravcomp="{link.mass / COUNTERWEIGHT}">'
        f'<inertial mass="{COUNTERWEIGHT}" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/></body>'
    )


def _bare_arm(path: Path, wanted: str, arm: ArmModel) -> tuple[mujoco.MjModel, str, float]:
    """Return the model of the arm up to its flange, the flange's name, and the undone rotation, rad."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        for kind in ("geoms", "meshes", "hfields", "skins", "materials", "textures", "cameras", "lights"):
            _clear(spec, kind)
        for kind in ("actuators", "sensors", "keys", "excludes", "pairs", "equalities", "tendons"):
            _clear(spec, kind)
        spec.compiler.fusestatic = False
        whole = spec.compile()
        parent, pos, quat, flange = _flange(path, spec, whole, wanted)
        site = parent.add_site(name=_FLANGE)
        site.pos, site.quat = pos, quat
        spec.compiler.fusestatic = True
        spec.option.gravity = (0.0, 0.0, -GRAVITY)
        model = spec.compile()
    except ValueError as error:
        raise ConfigError(f"{path}: not an arm that MuJoCo reads: {' '.join(str(error).split())}"[:300]) from None
    _require_chain(path, model)
    return model, flange, _undo_turn(model, arm)


def _clear(spec: mujoco.MjSpec, kind: str) -> None:
    for element in list(getattr(spec, kind)):
        spec.delete(element)


def _flange(
    path: Path, spec: mujoco.MjSpec, whole: mujoco.MjModel, wanted: str
) -> tuple[mujoco.MjsBody, Vector, Vector, str]:
    """Return body, position, quaternion and name of the flange; a flange body is removed with all bodies behind it."""
    for name in (wanted,) if wanted else FLANGES:
        if (site := spec.site(name)) is not None:
            index = whole.site(name).id
            return site.parent, whole.site_pos[index].copy(), whole.site_quat[index].copy(), name
        if (body := spec.body(name)) is not None:
            found = body.parent, whole.body_pos[whole.body(name).id].copy(), whole.body_quat[whole.body(name).id].copy()
            spec.delete(body)
            return *found, name
    names = [body.name for body in spec.bodies[1:]] + [site.name for site in spec.sites]
    allowed = ", ".join(filter(None, names)) or "a body or site with a name, of which the file has none,"
    raise ConfigError(f"{path}: no flange {wanted or ' or '.join(FLANGES)}; {allowed} allowed")


def _require_chain(path: Path, model: mujoco.MjModel) -> None:
    hinges = [int(kind) == int(mujoco.mjtJoint.mjJNT_HINGE) for kind in model.jnt_type]
    bodies = [int(body) for body in model.jnt_bodyid]
    is_chain = bodies == list(range(1, JOINTS + 1)) and [int(model.body_parentid[b]) for b in bodies] == list(
        range(JOINTS)
    )
    if len(hinges) != JOINTS or not all(hinges) or not is_chain or model.nbody != JOINTS + 1:
        raise ConfigError(
            f"{path}: {len(hinges)} joints, {sum(hinges)} of them hinges, before the flange; one chain of {JOINTS} hinges allowed"
        )


def _undo_turn(model: mujoco.MjModel, arm: ArmModel) -> float:
    """Rotate the flange's frame back about its z by a multiple of 45 degrees; return the rotation, rad.

    The result has the orientation of the cell's flange.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = arm.home
    mujoco.mj_kinematics(model, data)
    across = _believed_flange(arm, np.array(arm.home)).rotation.T @ data.site(_FLANGE).xmat.reshape(3, 3)
    turn = QUARTER * round(math.atan2(across[1, 0], across[0, 0]) / QUARTER)
    site = model.site(_FLANGE).id
    back = np.array([math.cos(turn / 2), 0.0, 0.0, -math.sin(turn / 2)])
    mujoco.mju_mulQuat(model.site_quat[site], model.site_quat[site].copy(), back)
    return turn


def _believed_flange(arm: ArmModel, q: Vector) -> Pose:
    rotations, origins = links(arm, q)
    return Pose(origins[-1] + arm.kinematics.flange * rotations[-1][:, 2], rotations[-1])


def _relative(described: DescribedArm, arm: ArmModel) -> list[tuple[Vector, Vector]]:
    """Return axes and position of each described body in the frame of our link, with all joints at 0."""
    model, data = described.model, described.data
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    rotations, origins = links(arm, np.zeros(JOINTS))
    found = []
    for i, (R, at) in enumerate(zip(rotations, origins, strict=True)):
        body = int(model.jnt_bodyid[i])
        found.append((R.T @ data.xmat[body].reshape(3, 3), R.T @ (data.xpos[body] - at)))
    return found


def _move(places: Vector, quats: Vector, body: int, R: Vector, at: Vector) -> None:
    """Express a body's inertial pose in another frame; axes R and position `at` lead there."""
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, R.flatten())
    places[body] = R @ places[body] + at
    mujoco.mju_mulQuat(quats[body], quat, quats[body].copy())


def _mount(model: mujoco.MjModel, theirs: mujoco.MjModel, arm: ArmModel) -> None:
    """Mount the cell's hand on the described flange."""
    hand, site = model.body("hand").id, theirs.site(_FLANGE).id
    turn = np.array([math.cos(arm.hand.turn / 2), 0.0, 0.0, math.sin(arm.hand.turn / 2)])
    model.body_pos[hand] = theirs.site_pos[site]
    mujoco.mju_mulQuat(model.body_quat[hand], theirs.site_quat[site], turn)


def _weigh(model: mujoco.MjModel) -> None:
    """Give the links their described weight; hand, fingers and peg stay exactly compensated."""
    model.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
    for body in range(1, model.nbody):
        name = model.body(body).name
        if name.startswith("link"):
            model.body_gravcomp[body] = 0.0
        elif not name.startswith("believed"):
            model.body_gravcomp[body] = 1.0


def _seven(values: Vector) -> Seven:
    a, b, c, d, e, f, g = (float(value) for value in values)
    return a, b, c, d, e, f, g
