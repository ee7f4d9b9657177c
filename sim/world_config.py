"""Config models of the simulated world; imports no physics."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from drivers.parts import ConfigModel

Coefficient = Annotated[float, Field(ge=0.0, le=2.0)]
Spread = Coefficient | tuple[Coefficient, Coefficient]
"""One value, or the interval that each trial draws from."""


class ContactConfig(ConfigModel):
    """Peg against plate."""

    friction: Spread
    """Coulomb coefficient; 0.1 to 0.4 covers dry to greased metal on metal."""


class GripConfig(ConfigModel):
    """Peg against pads."""

    friction: Spread
    """Coulomb coefficient of the rubber cover; together with force and length of contact it gives the pivot's break-away torque."""
    angle: Annotated[float, Field(ge=0.0, le=0.3)]
    """The peg is found in the rack within this in-hand angle, rad."""
    slip: Annotated[float, Field(ge=0.0, le=0.01)] = 0.0
    """How far the peg slides into the hand unnoticed when it is first pushed, m."""


class SimConfig(ConfigModel):
    """The simulated world itself."""

    timestep: Annotated[float, Field(ge=5e-5, le=1e-3)]
    """Of the physics, s; the control period must be a multiple of it."""
    pace: Annotated[float, Field(gt=0.0, le=100.0)] | Literal["max"] = 1.0
    """Multiple of real time that the clock keeps to, or as fast as it goes."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Of the first run; every further run of a session takes the next."""

    @model_validator(mode="after")
    def _divides(self) -> "SimConfig":
        steps = 1e-3 / self.timestep
        if abs(steps - round(steps)) > 1e-9:
            raise ValueError(f"timestep {self.timestep} s does not divide the control period of 0.001 s")
        return self


class SimArmConfig(ConfigModel):
    """The simulated Panda."""

    kind: Literal["sim"]


class SimGripperConfig(ConfigModel):
    """The simulated hand."""

    kind: Literal["sim"]


class SimSwitchConfig(ConfigModel):
    """The simulated switch."""

    kind: Literal["sim"]
