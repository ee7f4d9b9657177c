"""The calibration of one skin, gain of each taxel and point spread: its file, and a skin with corrected readings."""

from datetime import date
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.errors import ConfigError
from drivers.figures_file import read_figures, write_whole
from drivers.protocols import Skin
from drivers.quantities import TaxelFrame
from drivers.skin.layout import Layout, shape_of

Gain = Annotated[float, Field(ge=0.1, le=10.0)]


class SkinCalibration(ConfigModel):
    """Calibration of one skin."""

    date: date
    layout: Layout
    point_spread: Annotated[float, Field(ge=1e-4, le=1e-2)]
    """Standard deviation of the blur between a line on the pad and the taxels, m."""
    residual: Annotated[float, Field(ge=0.0, le=1.0)]
    """Root mean square of the readings that gains and point spread leave unexplained, fraction."""
    unmeasured: tuple[tuple[int, ...], tuple[int, ...]]
    """Numbers of the left and the right finger's taxels without a measured gain; their gain is given as 1."""
    left: tuple[Gain, ...]
    """Gains of the left finger's taxels; their mean is 1."""
    right: tuple[Gain, ...]
    """Gains of the right finger's taxels; their mean is 1."""

    def write(self, path: Path) -> None:
        """Write the calibration to a file.

        Raises:
            ConfigError: The file cannot be written.
        """
        rows = [", ".join(f"{gain:.4f}" for gain in gains) for gains in (self.left, self.right)]
        missing = ", ".join(str(list(numbers)) for numbers in self.unmeasured)
        text = (
            "# Measured by `cell calibrate skin`; SI units, gains about 1.\n"
            f'date = {self.date.isoformat()}\nlayout = "{self.layout}"\n'
            f"point_spread = {self.point_spread:.6g}\nresidual = {self.residual:.4g}\nunmeasured = [{missing}]\n"
            f"left = [{rows[0]}]\nright = [{rows[1]}]\n"
        )
        write_whole(path, text, "calibration")


def read_calibration(path: Path, layout: Layout) -> SkinCalibration:
    """Return the calibration in a file of `SkinCalibration.write`.

    Raises:
        ConfigError: The file is missing, or has another form or another layout.
    """
    found = read_figures(path, SkinCalibration, "calibration")
    if found.layout != layout:
        raise ConfigError(f'{path}: layout = "{found.layout}": skin.layout = "{layout}" wanted')
    taxels = shape_of(layout)[1]
    for name, gains in (("left", found.left), ("right", found.right)):
        if len(gains) != taxels:
            raise ConfigError(f"{path}: {name}: {len(gains)} gains; {taxels} wanted")
    return found


class CalibratedSkin:
    """A skin with every reading divided by its taxel's gain."""

    def __init__(self, skin: Skin, calibration: SkinCalibration) -> None:
        self.skin = skin
        self._gains = np.array([calibration.left, calibration.right])

    def open(self) -> None:
        """Open the skin."""
        self.skin.open()

    def close(self) -> None:
        """Close the skin."""
        self.skin.close()

    def read(self) -> TaxelFrame:
        """Return the newest frame, every value divided by its taxel's gain."""
        frame = self.skin.read()
        return TaxelFrame(frame.values / self._gains, frame.trusted, frame.stamp, frame.sequence)
