"""The base of every part's config model, and how a file that a config names is found; it knows no part and no device."""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo


def beside_config(path: Path, info: ValidationInfo) -> Path:
    """Return a relative path as seen from the folder of the config file that is validated."""
    folder: Path | None = (info.context or {}).get("folder")
    return path if folder is None else folder / path


FilePath = Annotated[Path, AfterValidator(beside_config)]
"""A file; a relative path begins at the folder of the config file, wherever the program was started."""


class ConfigModel(BaseModel):
    """Base of every config model: frozen, unknown keys are errors, no infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
