"""Config models of the simulated parts and of the world that they share; imports no physics."""

from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeInt

from drivers.arm.model import ArmName
from drivers.config_model import ConfigModel, FilePath
from drivers.part.contract import Part
from drivers.parts import Fraction
from drivers.quantities import FINGERS, TAXELS
from drivers.skin.health import SkinHealthConfig
from drivers.skin.layout import MODULE_TAXELS, Layout


class PadConfig(ConfigModel):
    """The elastomer over the taxels, and how its pressure becomes counts.

    Sources: [gibbons] for the elastomer; `assumed` values are the builder's choice, to be varied in studies.
    """

    stiffness: Annotated[float, Field(ge=1e3, le=1e6)] = 10e3
    """Stiffness of one pad at small depth, under a contact as long as the pad, N/m; assumed, study 0.5 to 2 times as
    much."""
    thickness: Annotated[float, Field(ge=2e-4, le=1e-2)] = 1.1e-3
    """Depth at which the pad is solid, m; 1 mm of elastomer ([gibbons], Sec. VI) and some of the cover (assumed)."""
    exponent: Annotated[float, Field(ge=0.3, le=3.0)] = 1.0
    """Exponent of the answer at small depth, number; 1 is a bed of springs, 1.5 hardens as Hertz's contact, 0.5 has the plateau of a foam.
    Source: set for each trial."""
    blur: Annotated[float, Field(ge=1e-4, le=1e-2)] = 1.2e-3
    """Standard deviation of the point spread through 1 mm of elastomer, m; assumed, about the thickness."""
    taxel_diameter: Annotated[float, Field(ge=1e-3, le=7e-3)] = 4e-3
    """Diameter of the round area that one taxel averages over, m; assumed, about half the pitch of [gibbons], Sec. VI.
    """
    hold: Literal["force", "width"] = "width"
    """What the hand keeps constant while the peg is pushed across the pads. With `width` it is the fingers' distance,
    as in a hand whose gears hold: the pads stiffen, so that both together carry more than twice the grip force. With
    `force` it is the mean of the two loads: the average over the taxels then tells nothing of a push, and the hole
    event of [gibbons], Sec. IV, could not have worked."""


class SkinModel(ConfigModel):
    """The deviations of a simulated skin's taxels from perfect ones.

    Sources: [cyskin] (real recordings, see tests/line/test_recordings.py) for counts and noise; `assumed` values
    are the builder's choice, none of them kinder than the recordings.
    """

    noise: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0094
    """Standard deviation of the white noise, fraction of full scale; 188 counts, the middle one of the modules of [cyskin], see
    `skin.module_noise` of config/reality.toml."""
    gain_spread: Annotated[float, Field(ge=0.0, le=0.3)] = 0.05
    """Standard deviation of a taxel's gain about 1, fraction; assumed, the remainder after calibration."""
    drift: Annotated[float, Field(ge=0.0, le=0.01)] = 1.0e-3
    """Random walk of a taxel's offset in one second, fraction of full scale; 0.11 of the noise, as in [cyskin]."""
    creep: Fraction = 0.05
    """Part of the answer to a step that comes late, fraction; assumed, usual for silicone."""
    creep_time: Annotated[float, Field(ge=0.01, le=1e3)] = 5.0
    """Time constant of the part of an answer that comes late, s; assumed."""
    sensitivity: Annotated[float, Field(ge=1e-4, le=10.0)] = 0.05
    """Reading of a taxel for each pascal, counts/Pa; set so that touch peaks are those of [cyskin], see `full_scale`.
    """
    full_scale: Annotated[float, Field(ge=1e3, le=43e3)] = 20e3
    """Reading that noise and drift are fractions of, counts; the highest touch peak that [cyskin] publishes."""
    offset: Annotated[float, Field(ge=0.0, le=43e3)] = 5000.0
    """Mean raw reading of an untouched taxel, counts; assumed, [cyskin] has it removed."""
    dead_taxels: Annotated[NonNegativeInt, Field(le=FINGERS * TAXELS)] = 0
    """Number of taxels, drawn at random, that read zero. Source: set for each trial."""
    dead_modules: Annotated[NonNegativeInt, Field(le=FINGERS * TAXELS // MODULE_TAXELS)] = 0
    """Number of modules, drawn at random, that read zero, as one does in [cyskin]. Source: set for each trial."""
    pad: PadConfig = PadConfig()
    """The elastomer over the taxels."""


class SimSkinConfig(SkinModel):
    """The simulated skin; [gibbons] for rate and layout's pitch."""

    kind: Literal["sim"]
    """Kind of the skin: the simulated one. Source: set for each cell."""
    rate: Annotated[float, Field(ge=1.0, le=1000.0)] = 10.0
    """Rate of the frames, Hz; [gibbons], Sec. VI."""
    layout: Layout = "parallelogram"
    """Arrangement of the two modules of a finger; [gibbons] does not say which. Source: assumed."""
    silent_frames: Annotated[float, Field(ge=1.5, le=100.0)] = 3.5
    """Time without a frame after which the skin is silent, multiple of the period. Source: chosen, not measured."""
    health: SkinHealthConfig = SkinHealthConfig()
    """Conditions under which a taxel is not trusted."""


Instant = Annotated[float, Field(ge=0.0, le=1e6)]


class WireFaults(ConfigModel):
    """Faults that a technician may rehearse on the wire of an emulated board; times are the cell's, s.

    Source: set for each trial.
    """

    drop: Fraction = 0.0
    """Probability that a CAN frame, or a byte, is lost, fraction."""
    corrupt: Fraction = 0.0
    """Probability that a CAN frame, or a byte, arrives with one bit flipped, fraction."""
    delay: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Delay of everything on the wire, s."""
    resets: tuple[Instant, ...] = ()
    """Instants at which the board restarts, s."""
    unplugged: tuple[tuple[Instant, Instant], ...] = ()
    """Spans, from when to when, in which the board is neither powered nor connected, s."""


class SkinBoardConfig(SkinModel):
    """Section [boards.skin]: the emulated skin board, where the channel or port of [skin] is "emulated"."""

    faults: WireFaults = WireFaults()
    """Faults of the wire."""


class SwitchBoardConfig(ConfigModel):
    """Section [boards.switch]: the emulated switch board, where the port of [switch] is "emulated"."""

    faults: WireFaults = WireFaults()
    """Faults of the wire."""


class BoardsConfig(ConfigModel):
    """Section [boards]: emulated boards."""

    skin: SkinBoardConfig = SkinBoardConfig()
    """The emulated skin board."""
    switch: SwitchBoardConfig = SwitchBoardConfig()
    """The emulated switch board."""


Coefficient = Annotated[float, Field(ge=0.0, le=2.0)]
Spread = Coefficient | tuple[Coefficient, Coefficient]
"""One value, or the interval that each trial draws from evenly."""


class ContactConfig(ConfigModel):
    """Friction of peg against plate."""

    friction: Spread
    """Coulomb coefficient of peg against plate, ratio; 0.1 to 0.4 covers dry to greased metal on metal. Source: assumed."""


class GripConfig(ConfigModel):
    """Friction and place of the peg between the pads."""

    friction: Spread
    """Coulomb coefficient of the rubber cover, ratio; with force and length of contact it gives the break-away torque
    of the pivot. Source: assumed.
    """
    angle: Annotated[float, Field(ge=0.0, le=0.3)]
    """Largest in-hand angle at which the peg is found in the rack, rad. Source: assumed."""
    shear_stiffness: Annotated[float, Field(ge=5e3, le=5e4)] = 5e4
    """Stiffness of both pads in their plane under the closed grip as the cell believes it, N/m; assumed: rubber of 60 kPa shear modulus,
    180 mm² a pad under an 8 mm peg, 0.4 mm of it left. The true one is drawn below it, see `grip.shear_stiffness` of config/reality.toml."""
    slip: Annotated[float, Field(ge=0.0, le=0.01)] = 0.0
    """Distance by which the peg slides unnoticed into the hand when it is first pushed, m. Source: assumed."""


CLOSED = {"exact", "unpredicted"}
"""Models of the hole in closed form."""
HOLES = {"round": CLOSED | {"flats", "boxes"}, "rectangular": CLOSED}
"""Models of the hole by kind of part; flats and a ring of boxes need a round hole."""


class ModelConfig(ConfigModel):
    """Choice of physical models; the defaults follow from `cell study contact`."""

    hole: Literal["exact", "unpredicted", "flats", "boxes"] = "exact"
    """Model of the hole; `exact` is in closed form, `unpredicted` leaves out contacts that are still apart, `flats` turn
    with the peg, `boxes` stand in a ring. Source: measured by `cell study contact`.
    """
    facets: Annotated[int, Field(ge=3, le=256)] = 64
    """Number of facets of the ring of boxes. Source: measured by `cell study contact`."""
    native_ccd: bool = False
    """Whether facets collide by MuJoCo's newer path, which makes ghost contacts at seams. Source: decision 0002."""
    time_constant: Annotated[float, Field(ge=0.1, le=1e3)] = 2.0
    """Time constant of the contacts, multiple of the time step. Source: measured by `cell study contact`."""
    contact_time: Annotated[float, Field(ge=0.0, le=0.1)] = 1e-3
    """Least time constant of the contacts, s; that of the shipped step near the hole, so that under a finer step they stay
    as soft, and forces as they are. Source: decision 0062.
    """
    stiffness: Annotated[float, Field(ge=1e2, le=1e10)] | None = None
    """Stiffness of the contacts instead of their time constant, with critical damping, 1/s²; force by penetration and
    effective mass. Source: set for each trial.
    """
    long_steps: bool = True
    """Whether steps are twice as long while nothing can touch the hole. Source: decision 0011; measured by `cell study contact`."""
    arm: Literal["full", "inertia"] = "full"
    """Model of the arm; `full` is the whole arm, `inertia` an inertia at the tool that the law moves, without the
    friction of joints. Source: measured by `cell study contact`.
    """
    wrist_backlash: Annotated[float, Field(ge=0.0, le=0.02)] = 0.0
    """Backlash between encoder and link of the joints 5 to 7, rad; the reading lags by half of it. Source: set for each trial."""
    grip: Literal["hinge", "pads"] = "hinge"
    """Model of the grip; a hinge with the pads' friction, or rigid pads in contact. Source: measured by `cell study contact`."""

    def has_hole_for(self, part: Part) -> bool:
        """Return whether this model of the hole serves such parts; facets have no chamfers."""
        return self.hole in (CLOSED if part.chamfer > 0.0 else HOLES[part.kind])


class FixtureConfig(ConfigModel):
    """[sim.fixture]: how the plate lies from part to part.

    Source: set for each trial.
    """

    mean: tuple[float, float] | None = None
    """Place of the hole's middle about which it is drawn for each part, m, base frame; none draws it once for the cell,
    evenly over the area of the hole."""
    deviation: Annotated[float, Field(ge=0.0, le=0.02)] = 0.0005
    """Standard deviation of the hole's place between parts, along x and along y, m; no hole lies outside its area."""


Times = Annotated[float, Field(gt=0.0, le=5.0)]


class DecoyKind(ConfigModel):
    """One kind of decoy; each value is the interval that a decoy draws from evenly.

    Source: chosen, not measured.
    """

    size: tuple[Times, Times]
    """Size of the decoy over the hole's, ratio."""
    depth: tuple[Annotated[float, Field(ge=1e-4, le=0.1)], Annotated[float, Field(ge=1e-4, le=0.1)]]
    """Depth of its floor, m."""


class DecoyConfig(ConfigModel):
    """[sim.plate.decoys]: places of the plate that a search may take for the hole; each is of a kind that is drawn alike.

    Source: chosen, not measured.
    """

    number: tuple[Annotated[int, Field(ge=0, le=5)], Annotated[int, Field(ge=0, le=5)]] = (0, 0)
    """Least and largest number of decoys on a plate, count."""
    blind: DecoyKind = DecoyKind(size=(0.8, 1.3), depth=(0.001, 0.005))
    """A blind hole, as a screw or a pin has it."""
    through: DecoyKind = DecoyKind(size=(1.5, 2.5), depth=(0.1, 0.1))
    """A hole through the plate that is too large."""
    dent: DecoyKind = DecoyKind(size=(0.5, 2.0), depth=(0.0004, 0.001))
    """A dent deeper than the dip of the tip that stops a search, with straight walls."""


class PlateConfig(ConfigModel):
    """[sim.plate]: what is true of the plate and stated nowhere else, so that no skill can read it.

    Source: set for each trial.
    """

    tilt: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    """Angle between the plate's normal and the vertical, rad, beside the drawn `place.plate_tilt`."""
    shallow: Annotated[float, Field(ge=0.0, le=0.02)] = 0.0
    """Height of the hole's bottom above where `hole.depth` has it, m, as of a chip in the hole."""
    present: bool = True
    """Whether the plate has the hole; without it every find is false."""
    latch_wear: Fraction = 0.0
    """Share of its force that the hole's latch has lost, fraction."""
    stick: Annotated[float, Field(ge=0.0, le=3.0)] = 0.0
    """Friction of the peg on the plate at rest over that of fast sliding, less 1, ratio; Stribeck's law, 0 is Coulomb's."""
    stick_speed: Annotated[float, Field(ge=1e-4, le=1.0)] = 0.01
    """Sliding speed at which 1/e of `stick` is left, m/s. Source: assumed."""
    ripple: Annotated[float, Field(ge=0.0, le=0.9)] = 0.0
    """Largest change of the friction from place to place, fraction."""
    ripple_length: Annotated[float, Field(ge=1e-3, le=0.1)] = 0.01
    """Distance after which that change repeats, along x as along y, m. Source: assumed."""
    decoys: DecoyConfig = DecoyConfig()
    """Other holes of the plate."""


class DescribedArmConfig(ConfigModel):
    """[sim.described]: an arm that other people described, in place of the one that the cell believes in.

    Source: set for each trial; decision 0078.
    """

    file: FilePath
    """URDF or MJCF file of an arm of seven hinges, with the base, zeros and signs of the cell's arm."""
    flange: str = ""
    """Name of the body or site that is the flange; what lies behind it is left out. Empty looks for the usual names."""
    sha256: str = ""
    """SHA-256 that the file has to have, hex; empty allows any."""
    takes: tuple[Literal["kinematics", "inertia", "friction", "rotors", "gravity"], ...] = (
        "kinematics",
        "inertia",
        "friction",
        "rotors",
        "gravity",
    )
    """What is taken from the description, the remainder being the cell's own. With `gravity` the links weigh what they weigh, and the
    arm's controller compensates what the cell believes."""


class SimConfig(ConfigModel):
    """The simulated world."""

    timestep: Annotated[float, Field(ge=5e-5, le=1e-3)]
    """Time step of the physics, s; the arm's control period must be a multiple of it. Source: decision 0027; measured by `cell study contact`."""
    pace: Annotated[float, Field(gt=0.0, le=100.0)] | Literal["max"] = 1.0
    """Pace of the cell's clock, multiple of real time; "max" is as fast as it goes. Source: set for each command."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the first run; every further run of a session takes the next. Source: set for each trial."""
    fixture: FixtureConfig | None = None
    """Fixture that holds the plate about one place; none draws the hole's place anew for every part, evenly over its area."""
    plate: PlateConfig = PlateConfig()
    """The true plate, where it differs from the stated one."""
    model: ModelConfig = ModelConfig()
    """How much of the physics is modelled."""
    described: DescribedArmConfig | None = None
    """Description of the true arm by other people; none takes the cell's own figures."""


class RealityConfig(ConfigModel):
    """Section [reality]: size of the errors of a simulated cell.

    Source: set for each trial; the errors and their sources in config/reality.toml.
    """

    scale: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    """Size of the errors that are drawn, ratio; 0 is ideal, 1 honest and 2 careless."""
    alone: str = ""
    """Name of the one error that is drawn, the others being ideal, as `arm.gravity`; empty draws all. Late scans are drawn with
    their delay."""
    without: tuple[str, ...] = ()
    """Names of errors that are not drawn, as `arm.sigmoid_friction`: in these the cell is as believed."""
    file: FilePath | None = None
    """File with the distributions of the errors; without one it is the `reality.toml` that ships with the program."""
    errors: dict[str, dict[str, dict[str, Any]]] = Field(default_factory=dict)
    """Errors in place of those of the file, each a table as it has them, as `errors.arm.gravity`; none takes them all from the file."""


class SimArmConfig(ConfigModel):
    """Section [arm] for the simulated arm.

    Source: set for each cell.
    """

    kind: Literal["sim"]
    """Kind of the arm: the simulated one."""
    model: ArmName = "panda"
    """Arm by its figures: one of those that ship, or a file of figures beside the config."""


class SimGripperConfig(ConfigModel):
    """Section [gripper] for the simulated hand.

    Source: set for each cell.
    """

    kind: Literal["sim"]
    """Kind of the gripper: the simulated hand."""


class SimSwitchConfig(ConfigModel):
    """Section [switch] for the simulated switch.

    Source: set for each cell.
    """

    kind: Literal["sim"]
    """Kind of the switch: the simulated one."""
