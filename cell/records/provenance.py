"""Provenance of a record: versions of packages, and fingerprints of the program's code and of the config."""

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from cell.records.versions import PROGRAM, installed

if TYPE_CHECKING:
    from cell.config.cell_config import CellConfig

PACKAGES = (PROGRAM, "mujoco", "numpy", "numba", "opencv-contrib-python-headless", "pymodbus")
"""Packages whose versions are in each record."""
OWN = ("cell", "drivers", "plc_bridge", "sim", "skills")
"""Packages of this program."""


@lru_cache
def versions() -> dict[str, str]:
    """Return the versions for a record, and a fingerprint of this program's code and arm files."""
    return {**{name: installed(name) for name in PACKAGES}, "code": _code_hash()}


def config_text(config: "CellConfig") -> str:
    """Return a whole config as one line of JSON; equal configs give equal text."""
    return json.dumps(config.model_dump(mode="json"), sort_keys=True)


def digest_of(text: str) -> str:
    """Return a short fingerprint of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def config_hash(config: "CellConfig") -> str:
    """Return a short fingerprint of a whole config."""
    return digest_of(config_text(config))


def _code_hash() -> str:
    root = Path(__file__).parent.parent.parent
    digest = hashlib.sha256()
    for package in OWN:
        for file in sorted((root / package).rglob("*.py")):
            digest.update(file.read_bytes())
    for file in sorted((root / "config" / "arms").glob("*.toml")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
