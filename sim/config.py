"""Config models of the simulated devices and of their common physics; imports no physics code."""

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field, NonNegativeInt

from drivers.arm.model import ArmName
from drivers.config_model import ConfigModel, Figure, FilePath, Quantity, Source
from drivers.parts import Fraction
from drivers.skin.health import SkinHealthConfig
from drivers.skin.layout import SOFTEST_SHEAR, STIFFEST_SHEAR, Layout


class PadConfig(ConfigModel):
    """The elastomer over the taxels, and the conversion of its pressure to counts.

    Sources: [gibbons] for the elastomer; `assumed` values are the developer's choice; studies vary them.
    """

    stiffness: Annotated[float, Figure("N/m"), Field(exclude=True), Source("assumed")] = 10e3
    """Stiffness of one pad at small depth, under a contact as long as the pad, N/m; studies vary it by 0.5 to 2."""
    thickness: Annotated[float, Figure("m"), Field(exclude=True), Source("[gibbons], Sec. VI; assumed")] = 1.1e-3
    """Depth at which the pad is fully compressed, m: 1 mm of elastomer and, assumed, part of the cover."""
    exponent: Annotated[float, Field(ge=0.3, le=3.0), Quantity("number"), Source("set for each trial")] = 1.0
    """Exponent of force over depth at small depth, number; 1 is a bed of springs, 1.5 a Hertz contact, 0.5 the plateau of a foam."""
    blur: Annotated[float, Field(ge=1e-4, le=1e-2), Quantity("m"), Source("assumed")] = 1.2e-3
    """Standard deviation of the point spread through 1 mm of elastomer, m; assumed, close to the thickness."""
    taxel_diameter: Annotated[float, Figure("m"), Field(exclude=True), Source("[gibbons], Sec. VI; assumed")] = 4e-3
    """Diameter of the round area that one taxel averages over, m; about half the pitch of [gibbons], Sec. VI."""


class SkinModel(ConfigModel):
    """Errors of a simulated skin's taxels.

    Sources: [cyskin] (real recordings, see tests/line/test_recordings.py) for counts and noise; `assumed` values are
    the developer's choice, none of them better than the recordings.
    """

    noise: Annotated[float, Field(ge=0.0, le=0.2), Quantity("fraction"), Source("[cyskin]")] = 0.0094
    """Standard deviation of the white noise, fraction of full scale; 188 counts, the median of the modules of [cyskin],
    see `skin.module_noise` of config/reality.toml."""
    drift: Annotated[float, Field(ge=0.0, le=0.01), Quantity("fraction"), Source("[cyskin]")] = 1.0e-3
    """Random walk of a taxel's offset in one second, fraction of full scale; 0.11 of the noise, as in [cyskin]."""
    dead_modules: Annotated[NonNegativeInt, Source("set for each trial")] = 0
    """Number of modules, drawn at random, that read zero, as one module of [cyskin] does."""
    pad: PadConfig = PadConfig()
    """The elastomer over the taxels."""


class SimSkinConfig(SkinModel):
    """The simulated skin; rate and taxel pitch as in [gibbons]."""

    kind: Annotated[Literal["sim"], Source("set for each cell")]
    """Kind of the skin: the simulated one."""
    rate: Annotated[float, Field(ge=1.0, le=1000.0), Quantity("Hz"), Source("[gibbons], Sec. VI")] = 10.0
    """Rate of the frames, Hz; [gibbons], Sec. VI."""
    layout: Annotated[Layout, Source("assumed")] = "parallelogram"
    """Arrangement of the two modules of a finger; [gibbons] does not state it."""
    gain_spread: Annotated[float, Field(ge=0.0, le=0.3), Quantity("fraction"), Source("assumed")] = 0.05
    """Standard deviation of a taxel's gain about 1, fraction; assumed, the remainder after calibration."""
    sensitivity: Annotated[float, Field(ge=1e-4, le=10.0), Quantity("counts/Pa"), Source("[cyskin]")] = 0.05
    """Sensitivity of a taxel, counts/Pa; set so that touch peaks equal those of [cyskin], see `full_scale`."""
    full_scale: Annotated[float, Field(ge=1e3, le=43e3), Quantity("counts"), Source("[cyskin]")] = 20e3
    """Full scale for the fractions of noise and drift, counts; the highest published touch peak of [cyskin]."""
    offset: Annotated[float, Field(ge=0.0, le=43e3), Quantity("counts"), Source("[cyskin]; assumed")] = 5000.0
    """Mean raw reading of an unloaded taxel, counts; assumed, [cyskin] publishes readings without it."""
    dead_taxels: Annotated[NonNegativeInt, Source("set for each trial")] = 0
    """Number of taxels, drawn at random, that read zero."""
    health: SkinHealthConfig = SkinHealthConfig()
    """Conditions under which a taxel is excluded."""


Instant = Annotated[float, Field(ge=0.0, le=1e6)]


class WireFaults(ConfigModel):
    """Faults on the wire of an emulated board, for practice; times are on the cell's clock, s."""

    SOURCE: ClassVar[str] = "set for each trial"

    drop: Annotated[Fraction, Quantity("fraction")] = 0.0
    """Probability of the loss of a CAN frame or byte, fraction."""
    corrupt: Annotated[Fraction, Quantity("fraction")] = 0.0
    """Probability of one flipped bit in a CAN frame or byte, fraction."""
    delay: Annotated[float, Field(ge=0.0, le=60.0), Quantity("s")] = 0.0
    """Delay of everything on the wire, s."""
    resets: Annotated[tuple[Instant, ...], Quantity("s")] = ()
    """Restart times of the board, s."""
    unplugged: Annotated[tuple[tuple[Instant, Instant], ...], Quantity("s")] = ()
    """Spans (start, end) without power and connection of the board, s."""


class SkinBoardConfig(SkinModel):
    """Section [boards.skin]: the emulated skin board, used if the channel or port of [skin] is "emulated"."""

    faults: WireFaults = WireFaults()
    """Faults of the wire."""


class SwitchBoardConfig(ConfigModel):
    """Section [boards.switch]: the emulated switch board, used if the port of [switch] is "emulated"."""

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
"""One value, or the interval of a uniform draw in each trial."""


class ContactConfig(ConfigModel):
    """Friction of peg against plate."""

    friction: Annotated[Spread, Quantity("ratio"), Source("assumed")]
    """Coulomb coefficient of peg against plate, ratio; 0.1 to 0.4 covers dry to greased metal on metal."""


class GripConfig(ConfigModel):
    """Friction and position of the peg between the pads."""

    friction: Annotated[Spread, Quantity("ratio"), Source("assumed")]
    """Coulomb coefficient of the rubber cover, ratio; together with grip force and contact length it sets the pivot's break-away torque."""
    angle: Annotated[float, Field(ge=0.0, le=0.3), Quantity("rad"), Source("assumed")]
    """Largest in-hand angle of a peg in the rack, rad."""
    shear_stiffness: Annotated[
        float, Field(ge=SOFTEST_SHEAR, le=STIFFEST_SHEAR), Quantity("N/m"), Source("assumed")
    ] = STIFFEST_SHEAR
    """Stiffness of both pads in their plane under the closed grip, as the cell assumes, N/m; assumed. Each trial draws a lower true
    value, see `grip.shear_stiffness` of config/reality.toml."""


class ModelConfig(ConfigModel):
    """Level of detail of the physics."""

    long_steps: Annotated[bool, Source("decision 0004")] = True
    """True to double the step while nothing can touch the hole."""
    wrist_backlash: Annotated[float, Field(ge=0.0, le=0.02), Quantity("rad"), Source("set for each trial")] = 0.0
    """Backlash between encoder and link of the joints 5 to 7, rad; the reading lags by half of it."""


class FixtureConfig(ConfigModel):
    """[sim.fixture]: distribution of the plate's position from part to part."""

    SOURCE: ClassVar[str] = "set for each trial"

    mean: Annotated[tuple[float, float] | None, Quantity("m")] = None
    """Mean position of the hole's centre over the parts, m, base frame. If none, it is drawn once per cell, uniformly
    over the area of the hole."""
    deviation: Annotated[float, Field(ge=0.0, le=0.02), Quantity("m")] = 0.0005
    """Standard deviation of the hole's position between parts along x and y, m; every hole lies inside its area."""


class DecoyKind(NamedTuple):
    """One kind of decoy; each value is the interval of a uniform draw."""

    size: tuple[float, float]
    """Size of the decoy relative to the hole, ratio."""
    depth: tuple[float, float]
    """Depth of the decoy's floor, m."""


class DecoyConfig(ConfigModel):
    """[sim.plate.decoys]: features of the plate that a search can mistake for the hole; all kinds are equally likely."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    number: Annotated[
        tuple[Annotated[int, Field(ge=0, le=5)], Annotated[int, Field(ge=0, le=5)]], Quantity("count")
    ] = (0, 0)
    """Smallest and largest number of decoys on a plate, count."""
    blind: Annotated[DecoyKind, Figure(""), Field(exclude=True)] = DecoyKind(size=(0.8, 1.3), depth=(0.001, 0.005))
    """A blind hole, as for a screw or a pin."""
    through: Annotated[DecoyKind, Figure(""), Field(exclude=True)] = DecoyKind(size=(1.5, 2.5), depth=(0.1, 0.1))
    """A hole through the plate that is too large."""
    dent: Annotated[DecoyKind, Figure(""), Field(exclude=True)] = DecoyKind(size=(0.5, 2.0), depth=(0.0004, 0.001))
    """A dent with straight walls, deeper than the dip depth that stops a search."""


class PlateConfig(ConfigModel):
    """[sim.plate]: true properties of the plate that no skill can read."""

    SOURCE: ClassVar[str] = "set for each trial"

    tilt: Annotated[float, Field(ge=0.0, le=0.2), Quantity("rad")] = 0.0
    """Angle between the plate's normal and the vertical, rad; `place.plate_tilt` is added."""
    shallow: Annotated[float, Field(ge=0.0, le=0.02), Quantity("m")] = 0.0
    """Height of the hole's bottom above the stated `hole.depth`, m; for example a chip in the hole."""
    present: bool = True
    """True if the plate has the hole; without it every detection is false."""
    latch_wear: Annotated[Fraction, Quantity("fraction")] = 0.0
    """Force loss of the hole's worn latch, fraction."""
    stick: Annotated[float, Field(ge=0.0, le=3.0), Quantity("ratio")] = 0.0
    """Friction at rest divided by friction of fast sliding, minus 1, ratio; Stribeck's law, 0 is Coulomb's law."""
    stick_speed: Annotated[float, Field(ge=1e-4, le=1.0), Quantity("m/s"), Source("assumed")] = 0.01
    """Sliding speed at which `stick` has fallen to 1/e, m/s."""
    ripple: Annotated[float, Field(ge=0.0, le=0.9), Quantity("fraction")] = 0.0
    """Amplitude of the friction's variation over the surface, fraction."""
    ripple_length: Annotated[float, Field(ge=1e-3, le=0.1), Quantity("m"), Source("assumed")] = 0.01
    """Period of `ripple` along x and along y, m."""
    decoys: DecoyConfig = DecoyConfig()
    """Other holes of the plate."""


class SimConfig(ConfigModel):
    """Section [sim]: physics, clock and seed of the simulated cell."""

    timestep: Annotated[
        float, Field(ge=5e-5, le=1e-3), Quantity("s"), Source("decision 0002; measured by `cell study contact`")
    ]
    """Time step of the physics, s; the arm's control period must be a multiple of it."""
    pace: Annotated[
        Annotated[float, Field(gt=0.0, le=100.0)] | Literal["max"], Quantity("multiple"), Source("set for each command")
    ] = 1.0
    """Pace of the cell's clock, multiple of real time; "max" is as fast as possible."""
    seed: Annotated[int, Field(ge=0), Source("set for each trial")] = 0
    """Seed of the first run; each further run of a session uses the next one."""
    fixture: FixtureConfig | None = None
    """Fixture that holds the plate near one position. If none, the hole is drawn per part, uniformly over its area."""
    plate: PlateConfig = PlateConfig()
    """True properties of the plate that differ from the stated ones."""
    model: ModelConfig = ModelConfig()
    """Level of detail of the physics."""


class RealityConfig(ConfigModel):
    """Section [reality]: scale and choice of the errors of a simulated cell."""

    SOURCE: ClassVar[str] = "set for each trial; the errors and their sources in config/reality.toml"

    scale: Annotated[float, Field(ge=0.0, le=10.0), Quantity("ratio")] = 1.0
    """Scale of the drawn errors, ratio; 0 is an ideal cell, 1 realistic and 2 careless."""
    alone: str = ""
    """Name of the only error to draw, such as `arm.gravity`; the others are ideal. If it is empty, all are drawn. Late
    scans are drawn together with their delay."""
    without: tuple[str, ...] = ()
    """Names of errors to leave ideal, such as `arm.sigmoid_friction`."""
    file: FilePath | None = None
    """File with the distributions of the errors; if none, the `reality.toml` shipped with the program."""
    errors: dict[str, dict[str, dict[str, Any]]] = Field(default_factory=dict)
    """Errors that replace those of the file, each in the form of the file, such as `errors.arm.gravity`; if none, all errors are
    the file's."""


class SimArmConfig(ConfigModel):
    """Section [arm] for the simulated arm."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["sim"]
    """Kind of the arm: the simulated one."""
    model: ArmName = "panda"
    """Arm model: a shipped one, or a file of figures beside the config."""


class SimGripperConfig(ConfigModel):
    """Section [gripper] for the simulated hand."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["sim"]
    """Kind of the gripper: the simulated hand."""


class SimSwitchConfig(ConfigModel):
    """Section [switch] for the simulated switch."""

    SOURCE: ClassVar[str] = "set for each cell"

    kind: Literal["sim"]
    """Kind of the switch: the simulated one."""
