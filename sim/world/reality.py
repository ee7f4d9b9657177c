"""Differences between the true cell and the cell assumed by the software, drawn per trial and hidden from all skills.

`config/reality.toml` contains distribution, unit and source of each error; `reality.scale` scales the errors. Every
error has its own random stream, which depends only on the trial's seed and the error's name. Adding, omitting or
isolating an error therefore does not change the others.
"""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, NonNegativeFloat, ValidationError, model_validator

from drivers.arm.model import JOINTS
from drivers.config_model import ConfigModel
from drivers.errors import ConfigError
from drivers.figures_file import read_toml
from drivers.parts import Fraction
from drivers.quantities import Vector
from drivers.skin.layout import Layout, fixed, module_of, shape_of
from sim.config import RealityConfig

REALITY_STREAM = 4
"""Key of the random streams of errors; the trial's position, readings, skin and search use lower keys."""
USUAL_LAYOUT: Layout = "parallelogram"
"""Layout of the skin if the cell states no other."""
RECORDED = ("trial", "axis", "joint", "module")
"""Kinds of draws recorded in a trial's row; values of single taxels follow from the seed."""


class ErrorKind(NamedTuple):
    """Rules for drawing and using one error."""

    each: str
    """Object that has one value each: trial, axis, joint, module, taxel, or taxel_axis (each coordinate of a taxel)."""
    ideal: float
    """Value in a cell that agrees with the software's assumptions."""
    part_of: str = ""
    """Name of the error that this error needs to have an effect; `reality.alone` with that name draws both."""

    def shape(self, layout: Layout) -> tuple[int, ...]:
        """Return the shape of a draw in a cell with this skin."""
        taxels = shape_of(layout)
        return {
            "trial": (),
            "axis": (3,),
            "joint": (JOINTS,),
            "module": (int(module_of(layout).max()) + 1,),
            "taxel": taxels,
            "taxel_axis": (*taxels, 2),
        }[self.each]


KINDS: dict[str, ErrorKind] = {
    "arm.rotor_inertia": ErrorKind("joint", 0.0),
    "arm.sigmoid_friction": ErrorKind("trial", 0.0),
    "arm.friction_level": ErrorKind("joint", 1.0),
    "arm.viscous_friction": ErrorKind("joint", 0.0),
    "arm.transport": ErrorKind("trial", 0.0),
    "arm.torque_lag": ErrorKind("trial", 0.0),
    "arm.gravity": ErrorKind("joint", 0.0),
    "arm.velocity_noise": ErrorKind("joint", 0.0),
    "arm.tcp_place": ErrorKind("axis", 0.0),
    "arm.joint_offsets": ErrorKind("joint", 0.0),
    "arm.wrench_torque": ErrorKind("joint", 0.0),
    "arm.wrench_noise": ErrorKind("trial", 0.0),
    "place.rack": ErrorKind("axis", 0.0),
    "place.plate_height": ErrorKind("trial", 0.0),
    "place.plate_tilt": ErrorKind("trial", 0.0),
    "peg.depth_in_hand": ErrorKind("trial", 0.0),
    "grip.force": ErrorKind("trial", 1.0),
    "grip.pad_friction": ErrorKind("trial", 1.0),
    "grip.shear_stiffness": ErrorKind("trial", 1.0),
    "latch.force": ErrorKind("trial", 1.0),
    "latch.place": ErrorKind("trial", 0.0),
    "skin.module_noise": ErrorKind("module", 1.0),
    "skin.noise_level": ErrorKind("taxel", 1.0),
    "skin.taxel_place": ErrorKind("taxel_axis", 0.0),
    "skin.dead_taxel": ErrorKind("taxel", 0.0),
    "skin.age": ErrorKind("trial", 0.0),
    "scan.late": ErrorKind("trial", 0.0),
    "scan.delay": ErrorKind("trial", 0.0, part_of="scan.late"),
}
"""Kind of every error by its name in the file; the file must contain each name once."""

Figure = float | tuple[float, ...]
Drawn = Mapping[str, Vector]
"""One trial's errors by name, each of the shape of its kind."""


@lru_cache
def as_believed(layout: Layout) -> Drawn:
    """Return the draw of a cell that agrees with the software's assumptions."""
    return {name: fixed(np.full(kind.shape(layout), kind.ideal)) for name, kind in KINDS.items()}


AS_BELIEVED: Drawn = as_believed(USUAL_LAYOUT)
"""Draw of a cell that agrees with the software's assumptions and has the usual skin."""


class ErrorModel(ConfigModel):
    """One error: its meaning, its distribution at scale 1, and its source."""

    about: Annotated[str, Field(min_length=10)]
    """Meaning of the error in words."""
    unit: Annotated[str, Field(min_length=1)]
    """Unit of the drawn value."""
    basis: Literal["measured", "published", "assumed"]
    """Basis of the figure; `assumed` if the source supports only its order of magnitude."""
    source: Annotated[str, Field(min_length=10)]
    """Source of the figure."""

    def figures(self) -> Mapping[str, Figure]:
        """Return the figures of the distribution by their keys."""
        return {key: value for key, value in self if isinstance(value, float | int | tuple)}


class Normal(ErrorModel):
    """Normal distribution about 0, cut off at 3 sigma."""

    distribution: Literal["normal"]
    sigma: NonNegativeFloat | tuple[NonNegativeFloat, ...]
    """Standard deviation, in `unit`."""

    def draw(self, rng: np.random.Generator, scale: float, shape: tuple[int, ...]) -> Vector:
        """Return one draw of a shape at a scale."""
        return np.asarray(scale * np.asarray(self.sigma) * _standard(rng, shape))


class Uniform(ErrorModel):
    """Uniform distribution between two bounds, which grow with the scale."""

    distribution: Literal["uniform"]
    low: Figure
    """Smallest value, in `unit`."""
    high: Figure
    """Largest value, in `unit`."""

    @model_validator(mode="after")
    def _is_ordered(self) -> "Uniform":
        if np.any(np.asarray(self.low) > np.asarray(self.high)):
            raise ValueError(f"low = {self.low}: above high = {self.high}; at most that allowed")
        return self

    def draw(self, rng: np.random.Generator, scale: float, shape: tuple[int, ...]) -> Vector:
        """Return one draw of a shape at a scale."""
        return np.asarray(scale * rng.uniform(self.low, self.high, shape))


class Factor(ErrorModel):
    """A factor about 1 with a uniformly distributed logarithm."""

    distribution: Literal["factor"]
    spread: Annotated[float, Field(ge=1.0)] | tuple[Annotated[float, Field(ge=1.0)], ...]
    """Largest factor; the smallest is its inverse."""

    def draw(self, rng: np.random.Generator, scale: float, shape: tuple[int, ...]) -> Vector:
        """Return one draw of a shape at a scale."""
        return np.asarray(np.asarray(self.spread) ** (scale * rng.uniform(-1.0, 1.0, shape)))


class Lognormal(ErrorModel):
    """A factor about 1 with a normally distributed logarithm, cut off at 3 sigma."""

    distribution: Literal["lognormal"]
    sigma: NonNegativeFloat
    """Standard deviation of the natural logarithm."""

    def draw(self, rng: np.random.Generator, scale: float, shape: tuple[int, ...]) -> Vector:
        """Return one draw of a shape at a scale."""
        return np.asarray(np.exp(scale * self.sigma * _standard(rng, shape)))


class Quantiles(ErrorModel):
    """A factor about 1 with measured quantiles.

    Its logarithm is uniform between neighbouring quantiles; the outermost ones are its limits.
    """

    distribution: Literal["quantiles"]
    shares: tuple[Fraction, ...]
    """Share of all draws at or below each of `values`."""
    values: tuple[Annotated[float, Field(gt=0.0)], ...]
    """Value at each share, in `unit`."""

    @model_validator(mode="after")
    def _is_ordered(self) -> "Quantiles":
        if len(self.shares) != len(self.values) or any(
            np.any(np.diff(each) < 0.0) for each in (self.shares, self.values)
        ):
            raise ValueError(f"values = {self.values}: as many as shares, both in ascending order, allowed")
        return self

    def figures(self) -> Mapping[str, Figure]:
        """Return no figures, because `shares` and `values` are not one per joint, axis or module."""
        return {}

    def draw(self, rng: np.random.Generator, scale: float, shape: tuple[int, ...]) -> Vector:
        """Return one draw of a shape at a scale."""
        # x = exp(scale · ln F^-1(u)), u uniform on 0 to 1.
        return np.asarray(np.exp(scale * np.interp(rng.uniform(size=shape), self.shares, np.log(self.values))))


class Range(ErrorModel):
    """A factor with a uniformly distributed logarithm over a physically fixed range."""

    distribution: Literal["range"]
    low: Annotated[float, Field(gt=0.0)]
    """Smallest factor."""
    high: Annotated[float, Field(gt=0.0)]
    """Largest factor."""

    def draw(self, rng: np.random.Generator, scale: float, shape: tuple[int, ...]) -> Vector:
        """Return one draw of a shape at a scale; for scales above 1 the range stays constant."""
        return np.asarray(np.exp(min(scale, 1.0) * rng.uniform(np.log(self.low), np.log(self.high), shape)))


class Chance(ErrorModel):
    """1 with a given probability, otherwise 0."""

    distribution: Literal["chance"]
    probability: Fraction
    """Probability of 1 at scale 1."""

    def draw(self, rng: np.random.Generator, scale: float, shape: tuple[int, ...]) -> Vector:
        """Return one draw of a shape at a scale."""
        return np.asarray(rng.uniform(size=shape) < min(scale * self.probability, 1.0), dtype=float)


AnyError = Annotated[
    Normal | Uniform | Factor | Lognormal | Quantiles | Range | Chance, Field(discriminator="distribution")
]


@dataclass(frozen=True, slots=True)
class Reality:
    """Errors described by one file."""

    errors: Mapping[str, AnyError]
    """The errors by their names."""

    def changed(self, tables: Mapping[str, Mapping[str, Any]]) -> "Reality":
        """Return these errors with the replacements from `reality.errors`.

        Raises:
            ConfigError: An error is unknown, without a source or out of bounds.
        """
        return Reality({**self.errors, **_errors("reality.errors", tables)})

    def draw(self, seed: int, reality: RealityConfig, layout: Layout = USUAL_LAYOUT) -> Drawn:
        """Return the draw of the trial with this seed in a cell with this skin; the values are read-only.

        Raises:
            ConfigError: `reality.alone` or `reality.without` names an unknown error, or `reality.alone` names an error
                that has no effect without another one.
        """
        if reality.alone not in ("", *self.errors):
            raise ConfigError(f"reality.alone = {reality.alone!r}: no such error; {', '.join(self.errors)} allowed")
        if reality.alone and (whole := KINDS[reality.alone].part_of):
            raise ConfigError(
                f"reality.alone = {reality.alone!r}: does nothing without {whole}; {whole} allowed, which draws both"
            )
        for name in set(reality.without) - set(self.errors):
            raise ConfigError(f"reality.without = {name!r}: no such error; {', '.join(self.errors)} allowed")
        drawn = dict(as_believed(layout))
        for name, error in self.errors.items():
            if reality.scale > 0.0 and reality.alone in ("", name, KINDS[name].part_of) and name not in reality.without:
                stream = np.random.SeedSequence(seed, spawn_key=(REALITY_STREAM, zlib.crc32(name.encode())))
                shape = KINDS[name].shape(layout)
                drawn[name] = fixed(error.draw(np.random.default_rng(stream), reality.scale, shape))
        return drawn


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of one cell and their scale."""

    reality: Reality
    config: RealityConfig
    layout: Layout
    """Layout of the skin."""

    def draw(self, seed: int) -> Drawn:
        """Return the draw of this seed.

        Raises:
            ConfigError: `reality.alone` or `reality.without` names an unknown error, or `reality.alone` names an error
                that has no effect without another one.
        """
        return self.reality.draw(seed, self.config, self.layout)


NO_ERRORS = Errors(Reality({}), RealityConfig(scale=0.0), USUAL_LAYOUT)
"""Errors of a cell that agrees with the software's assumptions."""


def read(path: Path) -> Reality:
    """Return the errors described by a file.

    Raises:
        ConfigError: The file is unreadable or not TOML, or an error is missing, unknown, without a source or out of
            bounds.
    """
    errors = _errors(str(path), read_toml(path))
    for name in KINDS:
        if name not in errors:
            raise ConfigError(f"{path}: {name}: missing; sigma = 0 or spread = 1 leaves an error out")
    return Reality({name: errors[name] for name in KINDS})


def recorded(drawn: Drawn) -> dict[str, str]:
    """Return the part of a draw that a trial's row records: values by name, separated by spaces.

    Values of taxels follow from the seed.
    """
    return {
        f"reality.{name}": " ".join(f"{value:.5g}" for value in drawn[name].flat)
        for name, kind in KINDS.items()
        if kind.each in RECORDED
    }


def _errors(path: str, tree: Mapping[str, Any]) -> dict[str, AnyError]:
    found = {}
    for group, tables in tree.items():
        if not isinstance(tables, dict):
            raise ConfigError(f"{path}: {group}: not a table; one table for each error needed, as [arm.gravity]")
        for key, table in tables.items():
            name = f"{group}.{key}"
            if name not in KINDS:
                raise ConfigError(f"{path}: {name}: no such error; {', '.join(KINDS)} allowed")
            found[name] = _error(path, name, table)
    return found


class _Holder(ConfigModel):
    """Wrapper of one error, whose model pydantic chooses by its distribution."""

    error: AnyError


def _error(path: str, name: str, table: Any) -> AnyError:
    try:
        model = _Holder.model_validate({"error": table}).error
    except ValidationError as error:
        # If a figure can be one number or several, pydantic reports both forms; the message at the deepest location is right.
        first = max(error.errors(), key=lambda said: len(said["loc"]))
        key = first["loc"][2] if len(first["loc"]) > 2 else "distribution"
        said = first["msg"].removeprefix("Value error, ")
        raise ConfigError(f"{path}: {name}.{key}: {said}; found {first['input']!r}".replace("\n", " ")[:400]) from None
    kind = KINDS[name]
    for key, figure in model.figures().items():
        if isinstance(figure, tuple) and kind.shape(USUAL_LAYOUT) != (len(figure),):
            raise ConfigError(f"{path}: {name}.{key}: {len(figure)} figures; one, or one for each {kind.each}, allowed")
    return model


def _standard(rng: np.random.Generator, shape: tuple[int, ...]) -> Vector:
    """Return standard normal draws; values beyond the limit are drawn again."""
    values = np.asarray(rng.standard_normal(shape))
    # Limit of normal draws, standard deviations from 0.
    while np.any(far := np.abs(values) > 3.0):
        values = np.where(far, rng.standard_normal(shape), values)
    return values
