"""The explicit table of estimators: the choices of `insert.estimator` and their sections of the config derive from it.

A new estimator is one module, with parameters and a class that has `estimate`, and one entry here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Generic, TypeVar

from pydantic import AfterValidator, WithJsonSchema
from pydantic_core import PydanticKnownError

from drivers.config_model import ConfigModel
from drivers.errors import ConfigError
from drivers.parts import Peg
from drivers.skin.layout import Layout
from skills.tactile.image import ImageEstimator, ImageParams
from skills.tactile.likelihood import LikelihoodEstimator, LikelihoodParams
from skills.tactile.pose import Estimator
from skills.tactile.robust import RobustEstimator, RobustParams

P = TypeVar("P", bound=ConfigModel)
Templated = TypeVar("Templated", LikelihoodParams, RobustParams)


@dataclass(frozen=True, slots=True)
class TouchSetup:
    """What an estimator is made for."""

    layout: Layout
    """Layout of the taxels."""
    peg: Peg
    """The peg that is held."""
    point_spread: float | None
    """Standard deviation of the elastomer's point spread as the skin's calibration found it, m; None without a calibration."""


@dataclass(frozen=True, slots=True)
class EstimatorEntry(Generic[P]):
    """One estimator: everything that the config and the assembly derive from it."""

    name: str
    """Name in `insert.estimator`, and of the estimator's section of the config."""
    params: type[P]
    make: Callable[[P, TouchSetup], Estimator]


def estimators(*entries: EstimatorEntry[Any]) -> dict[str, EstimatorEntry[Any]]:
    """Return the entries by name.

    Raises:
        ConfigError: Two have the same name.
    """
    table = {entry.name: entry for entry in entries}
    if len(table) < len(entries):
        names = [entry.name for entry in entries]
        twice = next(name for name in names if names.count(name) > 1)
        raise ConfigError(f"estimators: {twice}: the name of two; a free one allowed")
    return table


def _as_measured(params: Templated, setup: TouchSetup) -> Templated:
    """Return parameters with the point spread that the skin's calibration found, if it found one."""
    if setup.point_spread is None:
        return params
    templates = params.templates.model_copy(update={"blur": setup.point_spread})
    return params.model_copy(update={"templates": templates})


ESTIMATORS = estimators(
    EstimatorEntry("image", ImageParams, lambda params, setup: ImageEstimator(params, setup.layout)),
    EstimatorEntry(
        "ml",
        LikelihoodParams,
        lambda params, setup: LikelihoodEstimator(_as_measured(params, setup), setup.layout, setup.peg),
    ),
    EstimatorEntry(
        "robust",
        RobustParams,
        lambda params, setup: RobustEstimator(_as_measured(params, setup), setup.layout, setup.peg),
    ),
)


def _is_known(name: str) -> str:
    if name not in ESTIMATORS:
        raise PydanticKnownError("literal_error", {"expected": ", ".join(ESTIMATORS)})
    return name


EstimatorName = Annotated[str, AfterValidator(_is_known), WithJsonSchema({"type": "string", "enum": list(ESTIMATORS)})]
"""Name of an estimator of this table."""
