"""One licence, wherever it is named."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
LICENCE = "Apache-2.0"
SOURCES = [
    path
    for package in ("cell", "config", "drivers", "plc_bridge", "sim", "skills", "tests")
    for path in sorted((ROOT / package).rglob("*"))
    if path.suffix in (".py", ".c", ".h", ".toml", ".go")
]


def test_metadata_name_the_licence_of_the_licence_file():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (file,) = project["license-files"]
    title, version = (ROOT / file).read_text(encoding="utf-8").split("\n", 3)[1:3]

    assert (title.strip(), version.split(",")[0].strip()) == ("Apache License", "Version 2.0")
    assert project["license"] == LICENCE


def test_no_source_names_another_licence():
    named = {
        (str(path.relative_to(ROOT)), licence)
        for path in SOURCES
        for licence in re.findall(r"^\W*SPDX-License-Identifier: (.+?)\W*$", path.read_text(encoding="utf-8"), re.M)
    }

    assert named
    assert {licence for _, licence in named} == {LICENCE}
