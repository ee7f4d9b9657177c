"""Table of estimators: `insert.estimator` and the estimators' config sections derive from it.

To add an estimator, write one module with its parameters and a class with `estimate`, and add one entry here.
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
from skills.tactile.likelihood import RobustParams
from skills.tactile.pose import Estimator
from skills.tactile.robust import RobustEstimator

P = TypeVar("P", bound=ConfigModel)


@dataclass(frozen=True, slots=True)
class TouchSetup:
    """Hardware and peg that an estimator is built for."""

    layout: Layout
    """Layout of the taxels."""
    peg: Peg
    """Held peg."""
    point_spread: float | None
    """Standard deviation of the elastomer's point spread from the skin's calibration, m; None without a calibration."""


@dataclass(frozen=True, slots=True)
class EstimatorEntry(Generic[P]):
    """One estimator: its name, its parameters and its constructor."""

    name: str
    """Name in `insert.estimator` and of the estimator's config section."""
    params: type[P]
    make: Callable[[P, TouchSetup], Estimator]


def estimators(*entries: EstimatorEntry[Any]) -> dict[str, EstimatorEntry[Any]]:
    """Return the entries by name.

    Raises:
        ConfigError: Two entries have the same name.
    """
    table = {entry.name: entry for entry in entries}
    if len(table) < len(entries):
        names = [entry.name for entry in entries]
        twice = next(name for name in names if names.count(name) > 1)
        raise ConfigError(f"estimators: {twice}: the name of two; a free one allowed")
    return table


def _as_measured(params: RobustParams, setup: TouchSetup) -> RobustParams:
    """Return the parameters with the calibrated point spread, if there is a calibration."""
    if setup.point_spread is None:
        return params
    templates = params.templates.model_copy(update={"blur": setup.point_spread})
    return params.model_copy(update={"templates": templates})


ESTIMATORS = estimators(
    EstimatorEntry("image", ImageParams, lambda params, setup: ImageEstimator(params, setup.layout)),
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
