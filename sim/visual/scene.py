"""Scene of the pictures: arm, hand with its taxels, rack, plate, peg, bench, light and cameras.

It is a separate MuJoCo model, posed from recorded joint positions and poses by `Stage.pose`. It has no contacts, no
actuators and no relation to the models in `sim.world.scene`, so that drawing cannot change the simulation.

The arm is drawn from its Denavit-Hartenberg figures alone: a column along every offset d, a beam along every length a,
a housing about every joint in which two axes meet. It therefore looks like the arm of the figures, not like a
photograph.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from drivers.parts import Job
from drivers.quantities import FINGER_NAMES, Pose, Vector
from drivers.scene_facts import SceneFacts, felt, touch_colours
from drivers.skin.layout import finger_positions, pad_size, shape_of
from sim.visual import shapes

WHOLE, OPENED, BESIDE = 1, 2, 3
"""Groups of geoms: the whole plate, the plate cut open, and the objects between the section and its camera."""
MARGIN = 0.022
"""Width of the plate beyond the area of the hole's positions, m."""
SEEN = 0.085
"""Height of the region in the section, m."""
TRAIL = 2.5
"""Width of the tip's line on the plate, pixels."""
MOST_TRAIL = 1500
"""Largest number of segments of that line."""
HATCH = 0.004
"""Distance between the hatching lines along x, m."""
FINE = 'shadowsize="2048" offsamples="4"'
COARSE = 'offsamples="0" numslices="20" numstacks="8"'
"""Quality settings of single pictures (`FINE`) and of films (`COARSE`): shadows, smooth edges, facets of round shapes."""
CAMERA, LOOKS_AT = (0.88, -1.17, 0.60), (0.325, -0.02, 0.285)
"""Position of the camera of the whole cell, and its target point, m, base frame."""

PAINT = {
    "shell": "0.93 0.94 0.95 1",
    "joint": "0.20 0.23 0.27 1",
    "hand": "0.88 0.89 0.91 1",
    "metal": "0.62 0.65 0.69 1",
    "rubber": "0.10 0.11 0.13 1",
    "plate": "0.50 0.56 0.62 1",
    "rack": "0.33 0.42 0.52 1",
    "hollow": "0.06 0.07 0.08 1",
    "peg": "0.90 0.70 0.25 1",
    "bench": "0.74 0.77 0.80 1",
    "stand": "0.30 0.33 0.37 1",
    "floor": "0.70 0.73 0.76 1",
}


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """Visible state of the cell at one instant."""

    joints: Vector
    """Joint positions, rad."""
    width: float
    """Distance between the pads, m."""
    peg: Pose | None
    """Pose of the peg's centre, z from its end upward, base frame; None if it is unknown."""
    taxels: Vector
    """Readings of the taxels, counts, left finger first, shape (2, n)."""
    is_seated: bool = False
    """True if the switch under the hole is closed."""


class Stage:
    """The scene of one run, ready to be posed and rendered."""

    def __init__(
        self, facts: SceneFacts, hole: Pose | None, sight: tuple[int, int] = (1280, 720), is_fine: bool = True
    ) -> None:
        """Build the scene.

        Args:
            facts: Facts of the scene.
            hole: Pose of the hole's mouth, base frame; None leaves the plate solid.
            sight: Width and height of the largest picture to be rendered, pixels.
            is_fine: True for shadows, smooth edges and more facets, which take most of the time of a picture.
        """
        self.is_fine = is_fine
        self.model = mujoco.MjModel.from_xml_string(_xml(facts, hole, sight, FINE if is_fine else COARSE))
        self.data = mujoco.MjData(self.model)
        self._joints = len(facts.arm.kinematics.a)
        self._peg = int(self.model.body("peg").mocapid[0])
        taxels = shape_of(facts.layout)[1]
        self._taxels = np.array([[self.model.geom(f"{f}_{k}").id for k in range(taxels)] for f in FINGER_NAMES])
        self._lamp = int(self.model.geom("lamp").id)
        self._hatch()

    def _hatch(self) -> None:
        """Draw the hatching lines of technical drawings into the texture of the cut."""
        model, texture = self.model, self.model.texture("hatch").id
        side, start = int(model.tex_width[texture]), int(model.tex_adr[texture])
        across, down = np.meshgrid(np.arange(side), np.arange(side))
        is_line = (across + down) % side < side // 6
        pixels = np.where(is_line[..., None], [150, 86, 40], [226, 170, 112]).astype(np.uint8)
        model.tex_data[start : start + pixels.size] = pixels.ravel()

    def pose(self, moment: Moment) -> None:
        """Pose all bodies as at one instant."""
        data, model = self.data, self.model
        data.qpos[: self._joints] = moment.joints
        data.qpos[self._joints :] = moment.width / 2
        if moment.peg is None:
            data.mocap_pos[self._peg] = (0.0, 0.0, -10.0)
        else:
            data.mocap_pos[self._peg] = moment.peg.position
            mujoco.mju_mat2Quat(data.mocap_quat[self._peg], moment.peg.rotation.flatten())
        model.geom_rgba[self._taxels, :3] = touch_colours(felt(moment.taxels)) / 255
        model.geom_rgba[self._lamp] = (0.1, 0.9, 0.3, 1.0) if moment.is_seated else (0.25, 0.28, 0.25, 1.0)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)


def _xml(facts: SceneFacts, hole: Pose | None, sight: tuple[int, int], quality: str) -> str:
    paints = "".join(
        f'<material name="{name}" rgba="{rgba}" specular="{0.5 if name in ("metal", "peg", "plate") else 0.25}" '
        f'shininess="0.5" reflectance="0"/>'
        for name, rgba in PAINT.items()
    )
    meshes, fixtures = _fixtures(facts.job, hole)
    peg_mesh, peg = _peg(facts.job)
    hand_mesh, arm = _arm(facts)
    middle = hole.position if hole is not None else np.array(facts.job.hole.centre)
    return f"""<mujoco model="pictures">
    <compiler angle="radian" autolimits="false"/>
    <option gravity="0 0 0"><flag contact="disable"/></option>
    <visual>
      <global offwidth="{sight[0]}" offheight="{sight[1]}" fovy="40"/>
      <quality {quality}/>
      <headlight ambient="0.34 0.34 0.36" diffuse="0.22 0.22 0.22" specular="0.1 0.1 0.1"/>
      <map znear="0.02" zfar="30" shadowclip="0.8"/>
    </visual>
    <statistic extent="1" center="0.3 0 0.3"/>
    <asset>
      <texture name="sky" type="skybox" builtin="gradient" rgb1="0.95 0.97 0.99" rgb2="0.70 0.76 0.83" width="256" height="1536"/>
      <texture name="hatch" type="2d" builtin="flat" width="128" height="128"/>
      <material name="section" texture="hatch" specular="0" shininess="0" emission="0.25"/>
      {paints}{meshes}{peg_mesh}{hand_mesh}
    </asset>
    <default><geom contype="0" conaffinity="0" mass="0"/></default>
    <worldbody>
      <light pos="0.9 -0.9 2.2" dir="-0.33 0.40 -1" directional="true" diffuse="0.55 0.55 0.53" specular="0.3 0.3 0.3" castshadow="true"/>
      <light pos="-1 1 2" dir="0.5 -0.6 -1" directional="true" diffuse="0.20 0.21 0.23" specular="0 0 0" castshadow="false"/>
      <camera name="cell" pos="{_words(CAMERA)}" xyaxes="{_facing(CAMERA, LOOKS_AT)}" fovy="35.5"/>
      <camera name="section" projection="orthographic" fovy="{SEEN}" pos="{_words(middle + np.array([0.0, -0.4, 0.0155]))}" xyaxes="1 0 0 0 0 1"/>
      <geom type="plane" size="6 6 0.1" pos="0 0 -0.78" material="floor"/>
      <geom type="box" size="0.60 0.55 0.02" pos="0.32 0 -0.02" material="bench"/>
      <geom type="box" size="0.56 0.51 0.37" pos="0.32 0 -0.41" material="stand"/>
      {fixtures}{arm}
      <body name="peg" mocap="true">{peg}</body>
    </worldbody></mujoco>"""


def _fixtures(job: Job, hole: Pose | None) -> tuple[str, str]:
    """Return meshes and geoms of rack and plate."""
    rack = job.rack
    length, height = rack.pitch * rack.slots, rack.first[2]
    first = np.array(rack.first)
    middle = first + np.array([0.0, rack.pitch * (rack.slots - 1) / 2, 0.0])
    geoms = (
        f'<geom type="box" size="0.018 {length / 2 + 0.004} {height / 2 - 0.004}" pos="{middle[0]} {middle[1]} {height / 2 - 0.004}" material="stand" group="{BESIDE}"/>'
        f'<geom type="box" size="0.022 {length / 2 + 0.006} 0.004" pos="{middle[0]} {middle[1]} {height - 0.004}" material="rack" group="{BESIDE}"/>'
    )
    mouth = 0.6 * job.peg.part.widest
    for slot in range(rack.slots):
        at = first + np.array([0.0, rack.pitch * slot, 0.0])
        geoms += f'<geom type="cylinder" size="{mouth} 0.0004" pos="{_words(at)}" material="hollow" group="{BESIDE}"/>'
    mesh, plate = _plate(job, hole)
    return mesh, geoms + plate


def _plate(job: Job, hole: Pose | None) -> tuple[str, str]:
    centre, half = np.array(job.hole.centre), np.array(job.hole.area) / 2 + MARGIN
    # Thickness of the plate below the hole's floor, m.
    depth, thickness = job.hole.depth + 0.0005, job.hole.depth + 0.008
    stand = centre[2] - thickness
    posts = "".join(
        f'<geom type="cylinder" size="0.006 {stand / 2}" pos="{centre[0] + x * (half[0] - 0.01)} {centre[1] + y * (half[1] - 0.01)} {stand / 2}" material="metal" group="{WHOLE}"/>'
        for x in (-1, 1)
        for y in (-1, 1)
    )
    if hole is None:
        slab = f'<geom type="box" size="{half[0]} {half[1]} {thickness / 2}" pos="{centre[0]} {centre[1]} {centre[2] - thickness / 2}" material="plate"/>'
        return "", posts + slab + '<geom name="lamp" type="sphere" size="0.0001" pos="0 0 -5"/>'
    offset = hole.rotation.T @ (centre - hole.position)
    outline = (offset[0] - half[0], offset[0] + half[0], offset[1] - half[1], offset[1] + half[1])
    mouth, chamfer = job.hole.part.outline(), job.hole.chamfer
    reach = float(np.abs(mouth[:, 0]).max())
    meshes = _mesh("whole", shapes.perforated(outline, mouth, depth, thickness, False, chamfer))
    meshes += _mesh("opened", shapes.perforated(outline, mouth, depth, thickness, True, chamfer))
    faces = [
        ((outline[0], -thickness), (-reach, -thickness), (-reach, -chamfer), (outline[0], -chamfer)),
        ((reach, -thickness), (outline[1], -thickness), (outline[1], -chamfer), (reach, -chamfer)),
        ((-reach, -thickness), (reach, -thickness), (reach, -depth), (-reach, -depth)),
    ]
    if chamfer > 0.0:
        faces += [
            ((outline[0], -chamfer), (-reach, -chamfer), (-reach - chamfer, 0.0), (outline[0], 0.0)),
            ((reach, -chamfer), (outline[1], -chamfer), (outline[1], 0.0), (reach + chamfer, 0.0)),
        ]
    meshes += _cuts(faces)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, hole.rotation.flatten())
    return meshes, (
        f'{posts}<body pos="{_words(hole.position)}" quat="{_words(quat)}">'
        f'<geom type="mesh" mesh="whole" material="plate" group="{WHOLE}"/>'
        f'<geom type="mesh" mesh="opened" material="plate" group="{OPENED}"/>'
        f'<geom type="mesh" mesh="cuts" material="section" group="{OPENED}"/>'
        f'<geom type="box" size="0.0035 0.001 0.002" pos="0 -0.0005 {-depth - 0.004}" material="hollow" group="{OPENED}"/>'
        f'<geom name="lamp" type="sphere" size="0.0013" pos="0 -0.0015 {-depth - 0.004}" group="{OPENED}"/></body>'
    )


def _cuts(faces: Sequence[Sequence[tuple[float, float]]]) -> str:
    """Return the mesh of quadrangles in the plane of the cut, hatched at `HATCH`; x and z of each corner, m."""
    corners = [(x, -0.0001, z) for face in faces for x, z in face]
    triangles = [4 * k + corner for k in range(len(faces)) for corner in (0, 1, 2, 0, 2, 3)]
    places = [(x / HATCH, z / HATCH) for x, _, z in corners]
    return (
        f'<mesh name="cuts" vertex="{_words(corners)}" texcoord="{_words(places)}" '
        f'face="{" ".join(map(str, triangles))}" inertia="shell"/>'
    )


def _peg(job: Job) -> tuple[str, str]:
    half = (job.peg.length + job.peg.overhang) / 2
    part = job.peg.part
    edge = 0.05 * part.inscribed
    points = shapes.chamfered(part.outline(), -half, half, (part.chamfer or edge, edge))
    return f'<mesh name="peg" vertex="{_words(points)}"/>', '<geom type="mesh" mesh="peg" material="peg"/>'


def _arm(facts: SceneFacts) -> tuple[str, str]:
    """Return meshes and bodies of arm and hand, from the hand inward."""
    chain, turn = facts.arm.kinematics, facts.arm.hand.turn
    joints = len(chain.a)
    thick = np.linspace(0.066, 0.046, joints)
    hand_mesh, hand = _hand(facts)
    inner = f'<body pos="0 0 {chain.flange}" euler="0 0 {turn}">{hand}</body>'
    inner += _column(0.0, chain.flange - 0.012, float(thick[-1]) * 0.92) + _ring(chain.flange - 0.008, 0.042, 0.008)
    for i in range(joints - 1, -1, -1):
        a, d, alpha, r = chain.a[i], chain.d[i], chain.alpha[i], float(thick[i])
        # The upper part of the joint's column turns with the joint and stands in its frame.
        own = _column(-0.52 * d, 0.0, r) + _ring(-0.52 * d, r * 1.02, 0.006) if d else ""
        if not d:
            own += _housing(r)
        at = np.array([a, -d * math.sin(alpha), d * math.cos(alpha)])
        root = np.array([a, 0.0, 0.0])
        # The beam along a and the lower part of the column stand in the frame before the joint.
        before = ""
        if a:
            before += f'<geom type="capsule" size="{0.86 * r}" fromto="0 0 0 {a} 0 0" material="shell"/>'
        if d:
            before += f'<geom type="capsule" size="{r}" fromto="{_words(root)} {_words(root + 0.48 * (at - root))}" material="shell"/>'
        inner = (
            f'{before}<body name="link{i + 1}" pos="{_words(at)}" euler="{alpha} 0 0">'
            f'<joint type="hinge" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{own}{inner}</body>'
        )
    foot = (
        '<geom type="box" size="0.105 0.095 0.008" pos="-0.02 0 0.008" material="joint"/>'
        '<geom type="cylinder" size="0.085 0.035" pos="0 0 0.045" material="shell"/>'
    )
    return hand_mesh, foot + inner


def _column(low: float, high: float, radius: float) -> str:
    return f'<geom type="capsule" size="{radius}" fromto="0 0 {low} 0 0 {high}" material="shell"/>'


def _ring(height: float, radius: float, half: float) -> str:
    return f'<geom type="cylinder" size="{radius} {half}" pos="0 0 {height}" material="joint"/>'


def _housing(radius: float) -> str:
    """Return a joint in which two axes meet: a drum about the joint's axis with dark lids."""
    length = 0.98 * radius
    drum = f'<geom type="cylinder" size="{radius} {length}" material="shell"/>'
    lids = "".join(
        f'<geom type="cylinder" size="{0.80 * radius} 0.004" pos="0 0 {side * (length + 0.002)}" material="joint"/>'
        for side in (-1, 1)
    )
    return drum + lids


def _hand(facts: SceneFacts) -> tuple[str, str]:
    """Return the mesh of the hand's body, and hand and fingers in the hand's frame: z out of it, y along the closing axis."""
    hand, layout = facts.arm.hand, facts.layout
    length, width = pad_size(layout)
    base = hand.finger_centre - 0.045
    turns = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    disc = shapes.chamfered(0.0016 * np.column_stack([np.cos(turns), np.sin(turns)]), -0.0003, 0.0003, (0.0, 0.0))
    mesh = f'<mesh name="disc" vertex="{_words(disc)}"/>'  # a twentieth of the triangles of a cylinder
    mesh += f'<mesh name="hand" vertex="{_words(shapes.rounded_box((0.030, hand.stroke / 2 + 0.062, base / 2 - 0.003), 0.016))}"/>'
    body = (
        f'<geom type="cylinder" size="0.034 0.008" pos="0 0 0.004" material="joint"/>'
        f'<geom type="mesh" mesh="hand" pos="0 0 {base / 2 + 0.003}" material="hand"/>'
        f'<geom type="box" size="0.012 {hand.stroke / 2 + 0.040} 0.002" pos="0 0 {base}" material="joint"/>'
    )
    places = finger_positions(layout)
    for number, (name, sign) in enumerate(zip(FINGER_NAMES, (1, -1), strict=True)):
        root, tip = base - hand.finger_centre, length / 2 + 0.003
        # The finger frame has x out of the hand, and y across it along the hand's x.
        discs = "".join(
            f'<geom name="{name}_{k}" type="mesh" mesh="disc" pos="{y} {sign * 0.0002} {x}" euler="{math.pi / 2} 0 0"/>'
            for k, (x, y) in enumerate(places[number])
        )
        body += (
            f'<body name="{name}" pos="0 0 {hand.finger_centre}"><joint type="slide" axis="0 {sign} 0"/>'
            f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
            f'<geom name="{name}_pad" type="box" size="{width / 2} 0.002 {length / 2 + 0.002}" pos="0 {sign * 0.002} 0" material="rubber"/>'
            f'<geom name="{name}_finger" type="box" size="{0.42 * width} 0.005 {(tip - root) / 2}" pos="0 {sign * 0.009} {(tip + root) / 2}" material="metal"/>'
            f"{discs}</body>"
        )
    return mesh, body


def _mesh(name: str, mesh: shapes.Mesh) -> str:
    faces = " ".join(map(str, mesh.faces.ravel().tolist()))
    return f'<mesh name="{name}" vertex="{_words(mesh.vertices)}" face="{faces}" inertia="shell"/>'


def _facing(where: tuple[float, float, float], at: tuple[float, float, float]) -> str:
    """Return the x and y axes of an upright camera at `where` that looks at `at`, both m."""
    back = np.array(where) - np.array(at)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return _words(np.concatenate([right, np.cross(back, right)]))


def _words(values: object) -> str:
    return " ".join(f"{float(v):.9g}" for v in np.asarray(values).ravel())
