"""The unit of systemd that the page for physical cells gives: what it starts exists, and it may do little else."""

import re
import shutil
import subprocess
from configparser import ConfigParser
from pathlib import Path

import pytest

from cell.commands.arguments import Parser, add_shared
from cell.commands.cli import load_command
from cell.records.journal import default_folder

UNIT = Path("docs/examples/service/tactile-cell.service")
EXPOSURE = 30
"""Largest exposure, in tenths of systemd's own measure from 0 to 10; it calls up to 4.9 "OK" and a unit without limits 9.6."""


def setting(name: str) -> str:
    """Return the last value of a setting of the service."""
    unit = ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    unit.read(UNIT, encoding="utf-8")
    return unit["Service"][name]


def test_it_starts_a_command_that_the_program_has() -> None:
    program, *words = setting("ExecStart").split()
    assert Path(program).name == "cell"
    command = load_command(words[0])
    parser = Parser()
    add_shared(parser)
    command.add_arguments(parser)
    assert parser.parse_args(words[1:]).config == Path("/etc/tactile-cell/cell.toml")


def test_it_may_write_where_the_journal_is(monkeypatch: pytest.MonkeyPatch) -> None:
    data, cache = (word.partition("=")[2] for word in setting("Environment").split())
    monkeypatch.setenv("XDG_DATA_HOME", data)
    assert default_folder() == Path("/var/lib") / setting("StateDirectory")
    assert Path(cache) == Path("/var/cache")


def test_systemd_takes_it_and_finds_it_little_exposed(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not on this computer")
    there = re.sub(r"/opt/tactile-cell/bin/cell", "/bin/true", UNIT.read_text(encoding="utf-8"))
    unit = tmp_path / UNIT.name
    unit.write_text(re.sub(r"^(User|Group)=.*$", r"\1=root", there, flags=re.MULTILINE), encoding="utf-8")
    verified = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False)
    assert (verified.returncode, verified.stderr) == (0, "")
    judged = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", f"--threshold={EXPOSURE}", str(UNIT)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert judged.returncode == 0, judged.stdout
