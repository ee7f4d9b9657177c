"""CellConfig: the union of every part's config model, the checks across sections, and typed access to its values."""

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar

from pydantic import Field, create_model, field_validator, model_validator

from cell.config.checks import (
    require_apart,
    require_clear_way,
    require_permitted,
    require_pressed,
    require_printable,
    require_prior_inside,
    require_reach,
    require_shallow,
    require_stable,
    require_steady,
    require_turned_as_hole,
    require_workspace,
    require_workspace_in_reach,
)
from cell.config.files import ARMS, arm_file, has_file
from cell.config.margins import Place
from drivers.arm.franka_config import FrankaArmConfig
from drivers.arm.model import ArmModel, read_arm
from drivers.config_model import ConfigModel, FilePath, Quantity, Source
from drivers.errors import ConfigError
from drivers.gripper.franka_config import FrankaGripperConfig
from drivers.parts import HandShape, Hole, Job, Peg, Rack, require_fit
from drivers.skin.board_config import EMULATED, CanSkinConfig, HostSkinConfig, SerialSkinConfig
from drivers.switch.absent import NoSwitchConfig
from drivers.switch.board_config import SerialSwitchConfig
from plc_bridge.config import PlcConfig
from sim.config import (
    BoardsConfig,
    ContactConfig,
    GripConfig,
    RealityConfig,
    SimArmConfig,
    SimConfig,
    SimGripperConfig,
    SimSkinConfig,
    SimSwitchConfig,
)
from skills.catalogue import ADJUST, CATALOGUE, GRASP, SEARCH
from skills.contract import SkillParams
from skills.corner.params import CornerParams
from skills.entry import Skill, SkillSet
from skills.guards.limits import Limits
from skills.guards.scan_guards import ScanLimits
from skills.guards.wrench_zero import WrenchConfig
from skills.motion import Gains, Transfer
from skills.pace import Pace
from skills.paper.params import PaperParams
from skills.plan import InsertionPlan, is_cornered, plan_insertion
from skills.search.prior import LearningConfig
from skills.tactile.blend import Smoothing
from skills.tactile.estimators import ESTIMATORS, EstimatorEntry

P = TypeVar("P", bound=SkillParams)
E = TypeVar("E", bound=ConfigModel)
SIMULATED: dict[str, type[ConfigModel]] = {
    "arm": SimArmConfig,
    "gripper": SimGripperConfig,
    "skin": SimSkinConfig,
    "switch": SimSwitchConfig,
}
"""Config of each device if it is simulated."""
RECIPE_SECTIONS = frozenset({"preset", "peg", "hole", "rack", "corner", *(skill.section for skill in CATALOGUE.skills)})
"""Sections that a recipe can state: the part, its place and its handling, but not the hardware."""


class JournalConfig(ConfigModel):
    """[journal]: folder of the records of runs, and limits of their age and size."""

    SOURCE: ClassVar[str] = "chosen, not measured"

    folder: Annotated[str, Source("set for each cell")] = ""
    """Folder of the records of runs; empty is the user's own data folder."""
    days: Annotated[int, Field(ge=0, le=36500)] = 0
    """Age after which runs, their samples and events are deleted, days; 0 keeps all."""
    bytes: Annotated[int, Field(ge=0)] = 0
    """Total size of samples above which the oldest are deleted, bytes; their runs stay on record; 0 keeps all."""
    least_free: Annotated[int, Field(ge=0)] = 500_000_000
    """Free space of the disk below which the cell warns the PLC, bytes; below a tenth of it no samples are recorded."""


class PageConfig(ConfigModel):
    """[page]: the page for browsers, and the metrics."""

    SOURCE: ClassVar[str] = "set for each cell"

    names: tuple[Annotated[str, Field(pattern=r"^[A-Za-z0-9.-]{1,253}$")], ...] = ()
    """Host names by which browsers reach the page, besides the addresses and name of the computer, as in "cell-7.plant.example"."""


class CalibrationConfig(ConfigModel):
    """Section [calibration]: files of measured values."""

    SOURCE: ClassVar[str] = "measured by `cell calibrate`"

    skin: FilePath | None = None
    """File of the skin's measured gains and point spread, written by `cell calibrate skin`."""
    arm: FilePath | None = None
    """File of the measured friction and gravity residual of the arm's joints, written by `cell calibrate arm`; learning starts from it."""
    longest_age: Annotated[float, Field(gt=0.0, le=3.2e8), Quantity("s"), Source("chosen, not measured")] = 31536000.0
    """Age above which a file of measured values is refused, s; the default is 365 days."""


def _catalogued() -> type[ConfigModel]:
    """Return a model with a section for every skill and every estimator.

    A section can be left out if all of its keys have defaults.

    Raises:
        ConfigError: Two entries claim the same section.
    """
    fields: dict[str, Any] = {}
    for name, params in (
        *((skill.section, skill.params) for skill in CATALOGUE.skills),
        *((entry.name, entry.params) for entry in ESTIMATORS.values()),
    ):
        if name in fields:
            raise ConfigError(f"config: [{name}]: a skill and an estimator use this section; an unused name allowed")
        fields[name] = (params, ... if any(field.is_required() for field in params.model_fields.values()) else params())
    return create_model("Catalogued", __base__=ConfigModel, **fields)


if TYPE_CHECKING:
    # `CellConfig.params` and `estimator_params` give the sections of the catalogues their types.
    Catalogued = ConfigModel
else:
    Catalogued = _catalogued()


class CellConfig(Catalogued):
    """Config of one cell."""

    preset: Annotated[str, Source("set for each cell")] = ""
    """Name of a file in `presets/`, whose keys replace those of this file; empty is none."""
    world: Annotated[str, Source("set for each cell")] = ""
    """Name of a file in `worlds/`, another simulated world or scene. Its keys replace those of this file; a preset's replace both."""
    scan_rate: Annotated[float, Field(ge=10.0, le=1000.0), Quantity("Hz"), Source("chosen, not measured")]
    """Rate of the scan, Hz; a skill senses and decides once per scan."""
    retries: Annotated[int, Field(ge=0, le=10), Source("docs/tried/insertion.md")]
    """Number of new searches by `insert_peg` if the peg is not in the hole."""
    speed_scale: Annotated[float, Field(ge=0.05, le=20.0), Quantity("ratio"), Source("set for each cell")] = 1.0
    """Factor on every speed of the method, and divisor of its waiting times, ratio; the arm's limits cap the speeds."""
    scan: Annotated[ScanLimits, Source("decision 0015")] = ScanLimits()
    """Limits of late scans."""
    wrench: Annotated[WrenchConfig, Source("docs/tried/search.md")] = WrenchConfig()
    """Plausibility limits of the arm's estimated external wrench."""
    limits: Limits
    """Limits of force and workspace; beyond them a skill ends at once."""
    peg: Peg
    """The part to insert."""
    hole: Hole
    """The hole for the part."""
    rack: Rack
    """The rack with upright pegs."""
    corner: CornerParams | None = None
    """Handling of a peg with corners, instead of that of a round peg; required for such a peg."""
    paper: PaperParams | None = None
    """Choice of skills that run as printed in [gibbons] instead of the cell's own."""
    arm: Annotated[SimArmConfig | FrankaArmConfig, Field(discriminator="kind")]
    """The robot arm."""
    gripper: Annotated[SimGripperConfig | FrankaGripperConfig, Field(discriminator="kind")]
    """The hand."""
    skin: Annotated[SimSkinConfig | CanSkinConfig | SerialSkinConfig | HostSkinConfig, Field(discriminator="kind")]
    """The tactile skin on both fingers."""
    smoothing: Smoothing = Smoothing()
    """Filter of theta from frame to frame."""
    switch: Annotated[SimSwitchConfig | SerialSwitchConfig | NoSwitchConfig, Field(discriminator="kind")]
    """The success switch under the hole."""
    plc: PlcConfig
    """Connections to the PLC."""
    learning: LearningConfig = LearningConfig()
    """Learning from part to part while `cell serve` runs."""
    journal: JournalConfig = JournalConfig()
    """Storage of the records of runs."""
    page: PageConfig = PageConfig()
    """Host names of the page for browsers."""
    contact: ContactConfig | None = None
    """Contact of peg and plate in the simulated world."""
    grip: GripConfig | None = None
    """Grip of the pads on the peg in the simulated world."""
    sim: SimConfig | None = None
    """The simulated world."""
    reality: RealityConfig = RealityConfig()
    """Differences between the simulated cell and the model that the skills assume."""
    boards: BoardsConfig = BoardsConfig()
    """Emulated boards of skin and switch, which speak the real boards' protocols."""
    calibration: CalibrationConfig = CalibrationConfig()
    """Files of measured values."""

    @field_validator("paper")
    @classmethod
    def _is_chosen(cls, paper: PaperParams | None) -> PaperParams | None:
        return paper if paper is not None and paper.skills else None

    @model_validator(mode="after")
    def _fits(self) -> Self:
        peg, hole, rack = self.peg, self.hole, self.rack
        require_fit(peg, hole)
        if is_cornered(peg.part) and self.corner is None:
            raise ValueError(f'[corner]: missing; needed because peg.shape = "{peg.shape}"')
        require_shallow(peg, hole, rack)
        if self.is_simulated:
            require_apart(hole, rack)
        require_clear_way(self.params(GRASP), self.params(SEARCH), rack, peg)
        require_workspace(self.limits)
        require_prior_inside(hole, self.limits)
        require_pressed(hole.latch, self.params(ADJUST), self.params(GRASP), peg, self.limits)
        require_turned_as_hole(self.params(SEARCH), peg)
        if self.paper is not None:
            require_printable(self.paper, peg, hole)
        if self.switch.kind == "none" and hole.evidence == "switch":
            raise ValueError(
                'hole.evidence = "switch": this cell has no switch (switch.kind = "none"); "force" allowed'
            )
        return self

    @model_validator(mode="after")
    def _has_arm(self) -> Self:
        file = arm_file(self.arm.model)
        if not has_file(file):
            known = ", ".join(f'"{path.stem}"' for path in sorted(ARMS.glob("*.toml")))
            allowed = f"{known} or a file of figures, *.toml, allowed"
            raise ValueError(f'arm.model = "{self.arm.model}": no such arm; {allowed}')
        require_workspace_in_reach(self.limits, read_arm(file))
        place = self.place()
        require_reach(place, self.hole, self.limits)
        require_stable(self.steered(), self.skin.rate, place)
        require_steady(self.followed(), place)
        require_permitted(self.followed(), place.arm)
        return self

    @model_validator(mode="after")
    def _suits_its_arm(self) -> Self:
        simulated = [name for name in SIMULATED if getattr(self, name).kind == "sim"]
        missing = [name for name in ("contact", "grip", "sim") if getattr(self, name) is None]
        if simulated and missing:
            raise ValueError(f'[{missing[0]}]: missing; needed because {simulated[0]}.kind = "sim"')
        if self.arm.kind == "franka" and simulated:
            raise ValueError(f'{simulated[0]}.kind = "sim": needs a simulated arm; arm.kind = "franka" is a real one')
        return self

    @model_validator(mode="after")
    def _suits_its_boards(self) -> Self:
        if not self.is_simulated and self.is_skin_emulated():
            raise ValueError(f'skin.kind = "{self.skin.kind}": its board is "{EMULATED}", which needs a simulated arm')
        if not self.is_simulated and isinstance(self.switch, SerialSwitchConfig) and self.switch.port == EMULATED:
            raise ValueError(f'switch.port = "{EMULATED}": needs a simulated cell; the name of a port allowed')
        if self.is_simulated and self.gripper.kind != "sim":
            raise ValueError(
                f'gripper.kind = "{self.gripper.kind}": needs the real arm; "sim" allowed with a simulated one'
            )
        return self

    @model_validator(mode="after")
    def _fits_world(self) -> Self:
        if not self.is_simulated or self.sim is None:
            return self
        period = self.arm_model().control_period
        if abs(period / self.sim.timestep - round(period / self.sim.timestep)) > 1e-9:
            raise ValueError(
                f"sim.timestep = {self.sim.timestep}: does not divide the arm's control period of {period} s; a whole fraction of it allowed"
            )
        number = self.sim.plate.decoys.number
        if number[0] > number[1]:
            raise ValueError(
                f"sim.plate.decoys.number = {list(number)}: the least is above the largest; at most {number[1]} for the first allowed"
            )
        if self.sim.plate.shallow >= self.hole.depth:
            raise ValueError(
                f"sim.plate.shallow = {self.sim.plate.shallow}: no hole is left; less than hole.depth = {self.hole.depth} allowed"
            )
        return self

    def ways(self) -> dict[str, Transfer]:
        """Return the transfers through free space by key."""
        return {
            f"{skill.section}.{name}": value
            for skill in CATALOGUE.skills
            for name, value in self.params(skill)
            if isinstance(value, Transfer)
        }

    def followed(self) -> dict[str, Gains]:
        """Return all gains by key: those that act on errors measured by the skin, and those of transfers through free space."""
        return {**self.steered(), **{f"{key}.gains": way.gains for key, way in self.ways().items()}}

    def arm_model(self) -> ArmModel:
        """Return the figures of the cell's arm."""
        return read_arm(arm_file(self.arm.model))

    def arm_unit(self) -> str:
        """Return the identifier of the cell's own arm, for the files measured with it."""
        if isinstance(self.arm, FrankaArmConfig):
            return f"at {self.arm.host}"
        return f"simulated, seed {self.first_seed}"

    def place(self) -> Place:
        """Return the place and the attitude of the arm when the skin's measurement controls a peg at the hole."""
        search = self.plan().search
        return Place(
            arm=self.arm_model(),
            tip=self.hole.centre,
            part=self.peg.part,
            tilt_azimuth=search.tilt_azimuth,
            tilt=search.tilt,
            elbow=search.transfer.elbow,
            length=self.peg.length,
        )

    @property
    def first_seed(self) -> int:
        """Seed of the random draws in the first run; each further peg adds 1. It is 0 for a physical cell."""
        return self.sim.seed if self.is_simulated and self.sim is not None else 0

    @property
    def is_simulated(self) -> bool:
        """True if the arm is simulated. The section [sim] does not show this: a physical cell inherits it from its base."""
        return self.arm.kind == "sim"

    @property
    def is_realtime(self) -> bool:
        """True if the arm needs a computer with a real-time kernel."""
        return isinstance(self.arm, FrankaArmConfig) and self.arm.realtime == "enforce"

    def is_skin_emulated(self) -> bool:
        """True if the skin is the real driver, connected to an emulated board."""
        skin = self.skin
        return EMULATED in (getattr(skin, "channel", None), getattr(skin, "port", None))

    def is_skin_simulated(self) -> bool:
        """True if the skin is simulated, or the real driver is connected to an emulated board."""
        return self.skin.kind == "sim" or self.is_skin_emulated()

    def params(self, skill: Skill[P]) -> P:
        """Return the parameters of a skill."""
        params = getattr(self, skill.section)
        assert isinstance(params, skill.params)
        return params

    def estimator_params(self, estimator: EstimatorEntry[E]) -> E:
        """Return the parameters of an estimator."""
        params = getattr(self, estimator.name)
        assert isinstance(params, estimator.params)
        return params

    def with_params(self, skill: Skill[Any], **changes: Any) -> Self:
        """Return a copy with some parameters of a skill replaced, without validation."""
        params: SkillParams = self.params(skill)
        return self.model_copy(update={skill.section: params.model_copy(update=changes)})

    def steered(self) -> dict[str, Gains]:
        """Return all gains that act on errors measured by the skin, by key."""
        found = {
            f"{skill.section}.{name}": getattr(self.params(skill), name)
            for skill in CATALOGUE.skills
            for name in skill.steered
        }
        return found | self.plan().steered

    def skill_set(self) -> SkillSet:
        """Return the parameters of every skill."""
        return SkillSet(
            sections={skill.section: self.params(skill) for skill in CATALOGUE.skills},
            corner=self.corner,
            retries=self.retries,
            paper=self.paper,
            pace=self.pace(),
        )

    def pace(self) -> Pace:
        """Return the factor on all speeds, with the limits of the cell's arm."""
        arm = self.arm_model()
        return Pace(self.speed_scale, arm.tool_speed, arm.tool_turn_speed)

    def plan(self, attempt: int = 0) -> InsertionPlan:
        """Return the figures in force for the cell's own part after `attempt` failed attempts at one place."""
        return plan_insertion(self.skill_set(), self.peg, self.hole, attempt=attempt)

    def job(self, slot: int = 0) -> Job:
        """Return the part and its places, with the peg in the rack's `slot`."""
        hand = self.arm_model().hand
        shape = HandShape(**{name: getattr(hand, name) for name in HandShape.model_fields})
        return Job(peg=self.peg, hole=self.hole, rack=self.rack, hand=shape, slot=slot)


for _name in CellConfig.__annotations__.keys() & Catalogued.model_fields:
    raise ConfigError(
        f"config: [{_name}]: the section of a skill or an estimator has the name of a key of every cell; an unused name allowed"
    )
