"""CellConfig, the union of every part's config model, and how it is loaded: file, preset, recipe, single keys."""

import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

from pydantic import Field, ValidationError, create_model, model_validator

import config as shipped
from cell.config_errors import explain, renamed_key
from cell.margins import MARGIN, Place, too_high
from drivers.arm.franka_config import FrankaArmConfig
from drivers.arm.model import ArmModel, read_arm
from drivers.config_model import ConfigModel, FilePath
from drivers.errors import ConfigError
from drivers.gripper.franka_config import FrankaGripperConfig
from drivers.part.shapes import follow_shape
from drivers.parts import Hole, Job, Peg, Rack, require_fit
from drivers.skin.board_config import EMULATED, CanSkinConfig, SerialSkinConfig
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
from skills.catalogue import ADJUST, CATALOGUE, GRASP, INSERT, SEARCH
from skills.contract import SkillParams
from skills.corner import CornerParams
from skills.entry import Skill, SkillSet
from skills.handling import WAYS, Handling, Sections, handling
from skills.motion import Gains
from skills.prior import LearningConfig
from skills.scan_guards import ScanLimits
from skills.search.params import TOUCHED_TIME
from skills.setpoint_gate import Limits
from skills.tactile.blend import Smoothing
from skills.tactile.estimators import ESTIMATORS, EstimatorEntry
from skills.tactile.observer import ObserverParams

P = TypeVar("P", bound=SkillParams)
E = TypeVar("E", bound=ConfigModel)
SHIPPED = Path(shipped.__file__).parent
"""Folder of the configs that come with the program."""
DEFAULT = SHIPPED / "sim.toml"
ERRORS_FILE = "reality.toml"
"""Name of the shipped file of errors, which does not describe a cell."""
ARMS = SHIPPED / "arms"
"""Folder of the files of figures of the arms that come with the program."""
NOT_INHERITED = (("limits", "force"), ("limits", "low"), ("limits", "high"), ("hole", "centre"), ("rack", "first"))
"""Sections that a cell's file has to state itself, whatever its base states: limits, and the places of its parts."""
LEAST_TURN = 1e-3
"""Turn of a peg with corners against its hole that is left out of account, rad; what a rounded figure makes."""
RECIPE_SECTIONS = frozenset({"preset", "peg", "hole", "rack", "corner", *(skill.section for skill in CATALOGUE.skills)})
"""Sections that a recipe may state: the part, its place and how to handle it, but never the hardware."""


class JournalConfig(ConfigModel):
    """[journal]: where the records of runs go, and how many are kept.

    Source: chosen, not measured.
    """

    folder: str = ""
    """Folder that the records of runs go to; empty is the user's own data folder. Source: set for each cell."""
    days: Annotated[int, Field(ge=0, le=36500)] = 0
    """Days after which runs, their samples and events are deleted; 0 keeps all."""
    bytes: Annotated[int, Field(ge=0)] = 0
    """Size of all samples together, bytes, beyond which the oldest are deleted, while their runs stay on record; 0 keeps all."""
    least_free: Annotated[int, Field(ge=0)] = 500_000_000
    """Free space of the disk below which the PLC is warned, bytes; below a tenth of it no samples are recorded."""


class CalibrationConfig(ConfigModel):
    """Section [calibration]: files of measured values.

    Source: measured by `cell calibrate skin`.
    """

    skin: FilePath | None = None
    """File of the skin's measured gains and point spread, written by `cell calibrate skin`."""


def _catalogued() -> type[ConfigModel]:
    """Return a model with a section for every skill and every estimator.

    A section may be left out where all of its keys have defaults.

    Raises:
        ConfigError: Two entries claim the same section.
    """
    fields: dict[str, Any] = {}
    for name, params in (
        *((skill.section, skill.params) for skill in CATALOGUE.skills),
        *((entry.name, entry.params) for entry in ESTIMATORS.values()),
    ):
        if name in fields:
            raise ConfigError(f"config: [{name}]: the section of a skill and of an estimator; a free name allowed")
        fields[name] = (params, ... if any(field.is_required() for field in params.model_fields.values()) else params())
    return create_model("Catalogued", __base__=ConfigModel, **fields)


if TYPE_CHECKING:
    # `CellConfig.params` and `estimator_params` give the sections of the catalogues their types.
    Catalogued = ConfigModel
else:
    Catalogued = _catalogued()


class CellConfig(Catalogued):
    """Config of one cell."""

    preset: str = ""
    """Name of a file of `presets/` that is laid over this one; empty is none. Source: set for each cell."""
    scan_rate: Annotated[float, Field(ge=10.0, le=1000.0)]
    """Rate of the scan, in which a skill senses and decides once, Hz. Source: chosen, not measured."""
    retries: Annotated[int, Field(ge=0, le=10)]
    """Number of times that `insert_peg` searches anew when the peg turns out not to be in the hole. Source: decision 0021."""
    scan: ScanLimits = ScanLimits()
    """How late the scan may come. Source: decision 0054."""
    limits: Limits
    """Force and workspace that end a skill at once."""
    peg: Peg
    """The part to insert."""
    hole: Hole
    """The hole that the part goes into."""
    rack: Rack
    """The rack where pegs stand upright until they are taken."""
    corner: CornerParams | None = None
    """Handling of a peg with corners, which replaces that of a round peg; needed for such a peg."""
    arm: Annotated[SimArmConfig | FrankaArmConfig, Field(discriminator="kind")]
    """The robot arm."""
    gripper: Annotated[SimGripperConfig | FrankaGripperConfig, Field(discriminator="kind")]
    """The hand."""
    skin: Annotated[SimSkinConfig | CanSkinConfig | SerialSkinConfig, Field(discriminator="kind")]
    """The tactile skin on both fingers."""
    smoothing: Smoothing = Smoothing()
    """How theta is carried from frame to frame."""
    observer: ObserverParams = ObserverParams()
    """How theta may move between frames, where `smoothing.method` is "observer"."""
    switch: Annotated[SimSwitchConfig | SerialSwitchConfig, Field(discriminator="kind")]
    """The success switch under the hole."""
    plc: PlcConfig
    """The lines to the PLC."""
    learning: LearningConfig = LearningConfig()
    """What a served cell takes over from part to part."""
    journal: JournalConfig = JournalConfig()
    """Where the records of runs go."""
    contact: ContactConfig | None = None
    """Contact of peg and plate in the simulated world."""
    grip: GripConfig | None = None
    """Grip of the pads on the peg in the simulated world."""
    sim: SimConfig | None = None
    """The simulated world."""
    reality: RealityConfig = RealityConfig()
    """Differences of a simulated cell from what the software believes."""
    boards: BoardsConfig = BoardsConfig()
    """Emulated boards behind the wires of skin and switch."""
    calibration: CalibrationConfig = CalibrationConfig()
    """Files of measured values."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        peg, hole, rack = self.peg, self.hole, self.rack
        require_fit(peg, hole)
        section = WAYS[peg.part.kind].section
        if getattr(self, section) is None:
            raise ValueError(f'[{section}]: missing; needed because peg.shape = "{peg.shape}"')
        for name, depth in (("hole.depth", hole.depth), ("rack.depth", rack.depth)):
            if depth >= peg.length:
                raise ValueError(
                    f"{name} = {depth}: deeper than the peg reaches; less than peg.length = {peg.length} allowed"
                )
        (near, far), (least, most) = rack.bounds, hole.plate_bounds
        if self.sim is not None and all(near[i] < most[i] and least[i] < far[i] for i in range(2)):
            raise ValueError(
                f"rack.first = {list(rack.first)}: the rack overlaps the plate; slots outside x {least[0]:g} to {most[0]:g}, y"
                f" {least[1]:g} to {most[1]:g} allowed"
            )
        grasp, search = self.params(GRASP), self.params(SEARCH)
        if grasp.clearance <= rack.depth:
            raise ValueError(
                f"grasp.clearance = {grasp.clearance}: leaves the peg in its slot; more than rack.depth = {rack.depth} allowed"
            )
        slowest = (search.height + search.push_offset) / (search.touch_down - TOUCHED_TIME)
        if search.descent < slowest:
            raise ValueError(
                f"search.descent = {search.descent}: not down within search.touch_down = {search.touch_down} s;"
                f" at least {math.ceil(1e4 * slowest) / 1e4} allowed"
            )
        for low, high, axis in zip(self.limits.low, self.limits.high, "xyz", strict=True):
            if low >= high:
                raise ValueError(f"limits.low = {low} along {axis}: less than limits.high = {high} allowed")
        return self

    @model_validator(mode="after")
    def _has_time_for_scans(self) -> Self:
        if self.scan.longest < 2.0 / self.scan_rate:
            raise ValueError(
                f"scan.longest = {self.scan.longest}: less than two periods of the scan; at least {2.0 / self.scan_rate:g} allowed"
            )
        return self

    @model_validator(mode="after")
    def _has_reachable_prior(self) -> Self:
        hole = self.hole
        if hole.prior is not None:
            for low, high, mean, axis in zip(self.limits.low, self.limits.high, hole.prior.mean, "xyz", strict=False):
                if not low <= mean <= high:
                    raise ValueError(
                        f"hole.prior.mean = {list(hole.prior.mean)}: outside the workspace along {axis};"
                        f" {low:g} to {high:g} of limits.low and limits.high allowed"
                    )
        return self

    @model_validator(mode="after")
    def _is_turned_as_its_hole(self) -> Self:
        azimuth, part = self.params(SEARCH).tilt_azimuth, self.peg.part
        turn = part.least_turn(azimuth)
        if min(turn, part.symmetry - turn) > LEAST_TURN:
            raise ValueError(
                f'search.tilt_azimuth = {azimuth:g}: turns the hand, and with it a peg of peg.shape = "{self.peg.shape}",'
                f" against the hole; multiples of {part.symmetry:.4f} allowed"
            )
        return self

    @model_validator(mode="after")
    def _has_arm(self) -> Self:
        file = arm_file(self.arm.model)
        if not file.is_file():
            known = ", ".join(f'"{path.stem}"' for path in sorted(ARMS.glob("*.toml")))
            raise ValueError(
                f'arm.model = "{self.arm.model}": no such arm; {known} or a file of figures, *.toml, allowed'
            )
        read_arm(file)
        return self

    @model_validator(mode="after")
    def _is_stable(self) -> Self:
        place = self.place()
        if not place.is_within_reach():
            raise ValueError(
                f"hole.centre = {self.hole.centre}: the arm, {place.arm.name}, does not reach it with the peg upright and"
                f" tilted by {place.tilt} rad; a place within its reach allowed"
            )
        if self.limits.force > (most := place.largest_push()):
            raise ValueError(
                f"limits.force = {self.limits.force:g}: more than {place.arm.name} can press with at hole.centre;"
                f" at most {math.floor(most)} allowed"
            )
        for name, gains in self.steered().items():
            found = too_high(gains, self.skin.rate, place)
            if found is not None:
                raise ValueError(
                    f"{name}.{found.kind} = {found.gain:g}: unstable from {found.limit:.4g} with this damping ratio and"
                    f" frames at {self.skin.rate:g} Hz; at most {found.limit / MARGIN:.4g} allowed"
                )
        return self

    @model_validator(mode="after")
    def _has_world(self) -> Self:
        simulated = [name for name in ("arm", "gripper", "skin", "switch") if getattr(self, name).kind == "sim"]
        for name in ("contact", "grip", "sim"):
            if simulated and getattr(self, name) is None:
                raise ValueError(f'[{name}]: missing; needed because {simulated[0]}.kind = "sim"')
        if not simulated and self.is_skin_emulated():
            raise ValueError(f'skin.kind = "{self.skin.kind}": its board is "{EMULATED}", which needs a simulated arm')
        if not simulated and isinstance(self.switch, SerialSwitchConfig) and self.switch.port == EMULATED:
            raise ValueError(f'switch.port = "{EMULATED}": needs a simulated cell; the name of a port allowed')
        if self.arm.kind == "franka" and simulated:
            raise ValueError(f'{simulated[0]}.kind = "sim": needs a simulated arm, and arm.kind = "franka" is none')
        if self.arm.kind == "sim" and self.gripper.kind != "sim":
            raise ValueError(
                f'gripper.kind = "{self.gripper.kind}": needs the real arm; "sim" allowed with a simulated one'
            )
        period = self.arm_model().control_period
        if self.sim is not None and abs(period / self.sim.timestep - round(period / self.sim.timestep)) > 1e-9:
            raise ValueError(
                f"sim.timestep = {self.sim.timestep}: does not divide the arm's control period of {period} s; a part of it allowed"
            )
        if self.sim is not None and not self.sim.model.has_hole_for(self.peg.part):
            raise ValueError(
                f'sim.model.hole = "{self.sim.model.hole}": facets round a hole, and peg.shape = "{self.peg.shape}";'
                ' "exact" allowed'
            )
        if self.sim is not None and not self.hole.present and self.sim.model.hole not in ("exact", "unpredicted"):
            raise ValueError(
                f'sim.model.hole = "{self.sim.model.hole}": facets round a hole, and hole.present = false; "exact" allowed'
            )
        return self

    def arm_model(self) -> ArmModel:
        """Return the figures of the cell's arm."""
        return read_arm(arm_file(self.arm.model))

    def place(self) -> Place:
        """Return the place and the attitude in which the arm works with a peg that the skin steers."""
        search = self.handling().search
        return Place(
            arm=self.arm_model(),
            tip=self.hole.centre,
            part=self.peg.part,
            tilt_azimuth=search.tilt_azimuth,
            tilt=search.tilt,
            elbow=search.transfer.elbow,
            length=self.peg.length,
        )

    def require_simulated(self, what: str) -> None:
        """Make sure that this is a simulated cell.

        Raises:
            ConfigError: The cell is a real one; `what` is the command that needs a simulated one.
        """
        if self.arm.kind != "sim":
            raise ConfigError(f'{what}: arm.kind = "{self.arm.kind}": runs on simulated cells alone; "sim" allowed')

    def is_skin_emulated(self) -> bool:
        """Whether the skin is a driver with an emulated board behind its wire."""
        skin = self.skin
        return EMULATED in (getattr(skin, "channel", None), getattr(skin, "port", None))

    def is_skin_simulated(self) -> bool:
        """Whether the skin is a simulated one, or a driver with an emulated board behind its wire."""
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
        """Return a copy in which some parameters of a skill have other values, which are not checked."""
        params: SkillParams = self.params(skill)
        return self.model_copy(update={skill.section: params.model_copy(update=changes)})

    def steered(self) -> dict[str, Gains]:
        """Return all gains that act on what the skin tells, by key."""
        found = {
            f"{skill.section}.{name}": getattr(self.params(skill), name)
            for skill in CATALOGUE.skills
            for name in skill.steered
        }
        return found | dict(self.handling().steered)

    def skill_set(self) -> SkillSet:
        """Return the parameters of every skill."""
        return SkillSet(
            sections={skill.section: self.params(skill) for skill in CATALOGUE.skills},
            corner=self.corner,
            retries=self.handling().retries,
        )

    def handling(self) -> Handling:
        """Return the handling of the cell's own part."""
        sections = Sections(self.params(SEARCH), self.params(INSERT), self.params(ADJUST), self.corner, self.retries)
        return handling(self.peg.part, sections)

    def job(self, slot: int = 0) -> Job:
        """Return the part and its places, to be taken from the rack's `slot`."""
        return Job(peg=self.peg, hole=self.hole, rack=self.rack, slot=slot)


for _name in CellConfig.__annotations__.keys() & Catalogued.model_fields:
    raise ConfigError(
        f"config: [{_name}]: named by a skill or an estimator, and a key of every cell; a free name allowed"
    )


Origins = Mapping[tuple[str, ...], str]
"""Origin of each value, a file, `--set` or `parameter`, by the place of its key."""
SET = "--set"


@dataclass(frozen=True, slots=True)
class LoadedConfig:
    """A cell and the recipes that it knows, each a whole config of its own."""

    cell: CellConfig
    recipes: Mapping[int, CellConfig] = field(default_factory=dict)
    """Config of each recipe by its number; 0 is the cell's own part."""
    origins: Mapping[int, Origins] = field(default_factory=dict)
    """Origin of each value that is not a default, by recipe."""


def load(path: Path | None = None, preset: str | None = None, sets: Iterable[str] = ()) -> LoadedConfig:
    """Load a cell: what the file names as its `base`, the file, then its preset, then, for each recipe, the recipe's file, then single keys.

    `presets/` and `recipes/` stand beside the file; a preset that is not there is looked for among those that
    ship with the program.

    Args:
        path: TOML file of the cell; None is the simulated cell that ships with the program.
        preset: Name of the preset that replaces the file's own.
        sets: Single keys, `KEY=VALUE`; a value is TOML, a bare word a text.

    Raises:
        ConfigError: One line with file, key, what was found and what is allowed.
    """
    path = path or DEFAULT
    layers = _layers(path)
    keys = [parse_set(text) for text in sets]
    if preset is not None:
        keys.append((("preset",), preset))
    merged = {0: _merge(path, layers, None, keys)}
    for file in sorted((path.parent / "recipes").glob("*.toml")):
        if not file.stem.isdigit() or int(file.stem) == 0:
            raise ConfigError(f"{file}: recipes are named by their number; 01.toml to 65535.toml allowed")
        merged[int(file.stem)] = _merge(path, layers, file, keys)
    recipes = {number: cell for number, (cell, _) in merged.items()}
    return LoadedConfig(recipes[0], recipes, {number: origins for number, (_, origins) in merged.items()})


def _layers(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Return a cell's file by name, preceded by the one that its `base` names, which lies beside it or is shipped."""
    tree = read_toml(path)
    name = tree.pop("base", None)
    if name is None:
        return [(str(path), tree)]
    allowed = sorted(
        {file.name for place in (SHIPPED, path.parent) for file in place.glob("*.toml")} - {path.name, ERRORS_FILE}
    )
    if name not in allowed:
        raise ConfigError(f"{path}: base = {name!r}: no such file; {', '.join(allowed)} allowed")
    base = next(place / name for place in (path.parent, SHIPPED) if (place / name).is_file())
    below = read_toml(base)
    if "base" in below:
        raise ConfigError(f"{path}: base = {name!r}: has a base of its own; a file without one allowed")
    for section, key in NOT_INHERITED:
        below.get(section, {}).pop(key, None)
    return [(str(base), below), (str(path), tree)]


def arm_file(model: str) -> Path:
    """Return the file of figures that an `arm.model` names, which may not exist."""
    return Path(model) if model.endswith(".toml") else ARMS / f"{model}.toml"


def with_parameters(config: CellConfig, parameters: Iterable[tuple[str, Any]]) -> CellConfig:
    """Return a config with single values replaced, as a command may ask for; only keys of recipes can be replaced.

    Raises:
        ConfigError: A key is unknown, or a value is not allowed.
    """
    parameters = list(parameters)
    if not parameters:
        return config
    merged = config.model_dump()
    layer: dict[str, Any] = {}
    source: dict[tuple[str, ...], str] = {}
    for name, value in parameters:
        place = tuple(name.split("."))
        if place[0] not in RECIPE_SECTIONS - {"preset"}:
            raise ConfigError(
                f"parameter {name}: not for a command; keys of {', '.join(sorted(RECIPE_SECTIONS))} allowed"
            )
        _lay_over(layer, _nested(place, value), "parameter", {})
    _lay_layer(merged, layer, "parameter", source)
    return _validated(merged, source, "parameter", ["parameter"])


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        ConfigError: The file does not exist, is not readable, or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML: {error}".replace("\n", " ")) from None


def parse_set(text: str) -> tuple[tuple[str, ...], Any]:
    """Return path and value of `KEY.SUBKEY=VALUE`.

    Raises:
        ConfigError: The text has another form.
    """
    key, equals, literal = text.partition("=")
    if not equals or not re.fullmatch(r"\w+(\.\w+)*", key.strip()):
        raise ConfigError(f"--set {text}: KEY=VALUE or SECTION.KEY=VALUE allowed, as in peg.diameter=0.008")
    path = tuple(key.strip().split("."))
    try:
        return path, tomllib.loads(f"value = {literal}")["value"]
    except tomllib.TOMLDecodeError:
        return path, literal.strip()


def _merge(
    path: Path,
    layers: list[tuple[str, dict[str, Any]]],
    recipe: Path | None,
    keys: list[tuple[tuple[str, ...], Any]],
) -> tuple[CellConfig, Origins]:
    merged: dict[str, Any] = {}
    source: dict[tuple[str, ...], str] = {}
    part = {} if recipe is None else read_toml(recipe)
    for name in part:
        if name not in RECIPE_SECTIONS:
            raise ConfigError(f"{recipe}: {name}: not for a recipe; {', '.join(sorted(RECIPE_SECTIONS))} allowed")
    order = [name for name, _ in layers]
    for name, tree in layers:
        _lay_layer(merged, tree, name, source)
    preset = {**merged, **part, **{keyed[0]: value for keyed, value in keys if len(keyed) == 1}}.get("preset", "")
    if preset != "":
        file = _find_preset(path, preset)
        _lay_layer(merged, read_toml(file), str(file), source)
        order.append(str(file))
    _lay_layer(merged, part, str(recipe), source)
    merged["preset"] = preset
    single: dict[str, Any] = {}
    for keyed, value in keys:
        _lay_over(single, _nested(keyed, value), SET, {})
    _lay_layer(merged, single, SET, source)
    return _validated(merged, source, str(path), [*order, str(recipe), SET], path.parent), source


def _validated(
    merged: dict[str, Any], source: Origins, file: str, order: Sequence[str], folder: Path | None = None
) -> CellConfig:
    try:
        return CellConfig.model_validate(merged, context={"folder": folder})
    except ValidationError as error:
        raise ConfigError(explain(error, CellConfig, merged, source, file, order)) from None


def _nested(place: tuple[str, ...], value: Any) -> dict[str, Any]:
    for name in reversed(place):
        value = {name: value}
    nested: dict[str, Any] = value
    return nested


def presets(path: Path | None = None) -> dict[str, Path]:
    """Return the presets that a cell's file may name, and their files: those beside it, then those that are shipped."""
    folders = [SHIPPED / "presets", (path or DEFAULT).parent / "presets"]
    return {file.stem: file for place in folders for file in sorted(place.glob("*.toml"))}


def _find_preset(path: Path, name: Any) -> Path:
    known = presets(path)
    if name not in known:
        allowed = ", ".join(f'"{k}"' for k in sorted(known)) or "none"
        raise ConfigError(f"preset = {name!r}: no such file in presets/; {allowed} allowed")
    return known[name]


def _lay_layer(below: dict[str, Any], above: Mapping[str, Any], name: str, source: dict[tuple[str, ...], str]) -> None:
    """Merge a whole layer into what is below it; a size that it keeps takes the key of the peg's shape."""
    if (told := renamed_key(above)) is not None:
        raise ConfigError(f"{name}: {told}")
    _lay_over(below, above, name, source)
    try:
        renamed = follow_shape(below, above)
    except ValueError as error:
        raise ConfigError(f"{name}: {error}") from None
    for section, old, new in renamed:
        source[section, new] = source.pop((section, old), name)


def _lay_over(
    below: dict[str, Any],
    above: Mapping[str, Any],
    name: str,
    source: dict[tuple[str, ...], str],
    at: tuple[str, ...] = (),
) -> None:
    """Merge `above` into `below`, tables key by key, other values whole, and note the origin of each key."""
    for key, value in above.items():
        place = (*at, key)
        if isinstance(value, Mapping) and (key not in below or isinstance(below[key], dict)):
            below[key] = dict(below.get(key, {}))
            source.setdefault(place, name)
            _lay_over(below[key], value, name, source, place)
        else:
            below[key] = value
            source[place] = name
