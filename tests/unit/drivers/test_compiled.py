"""The cache of compiled functions is never stale, and never somebody else's; what is compiled is always the same."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from drivers import compiled

CALLEE = "from drivers.compiled import njit\nWORD = {word}\n@njit(cache=True)\ndef callee():\n    return WORD\n"
CALLER = (
    "from drivers.compiled import njit\nfrom drivers.callee import callee\n@njit(cache=True)\ndef caller():\n"
    "    return callee()\nprint(caller(), sum(caller.stats.cache_hits.values()))\n"
)


UNKEPT = (
    "import ctypes\nfrom drivers.compiled import njit\ncosine = ctypes.CDLL(None).cos\n"
    "cosine.argtypes, cosine.restype = [ctypes.c_double], ctypes.c_double\n@njit(cache=True)\ndef caller():\n"
    "    return cosine(0.0)\nprint(caller(), sum(caller.stats.cache_hits.values()))\n"
)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Return a project with the cache under test, a compiled function and its caller."""
    drivers = tmp_path / "drivers"
    drivers.mkdir()
    shutil.copy(compiled.__file__, drivers / "compiled.py")
    (drivers / "callee.py").write_text(CALLEE.format(word=1))
    (drivers / "caller.py").write_text(CALLER)
    return tmp_path


def run(project: Path) -> list[str]:
    """Run the caller in its own process; return its result, and the number of cache hits."""
    environment = os.environ | {"PYTHONPATH": str(project), "XDG_CACHE_HOME": str(project / "home")}
    command = [sys.executable, "-m", "drivers.caller"]
    done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_a_function_is_compiled_anew_after_a_change_and_if_others_may_write(project: Path) -> None:
    first, again = run(project), run(project)
    (project / "drivers" / "callee.py").write_text(CALLEE.format(word=2))
    assert (first, again, run(project)) == (["1", "0"], ["1", "1"], ["2", "0"])
    (project / "home" / "tactile-cell" / "compiled").chmod(0o777)
    assert run(project) == ["2", "0"]


def test_a_function_that_cannot_be_kept_is_compiled_at_each_start(project: Path) -> None:
    (project / "drivers" / "caller.py").write_text(UNKEPT)
    assert [run(project), run(project)] == [["1.0", "0"]] * 2


def test_the_sources_of_an_engine_include_the_law() -> None:
    names = {path.name for path in compiled.sources(compiled.PROJECT / "sim" / "world" / "engine.py")}
    assert {"engine.py", "table.py", "impedance.py", "joint_drive.py", "model.py", "errors.py"} <= names


def test_no_compiled_function_may_take_its_sums_in_another_order() -> None:
    files = [path for name in compiled.PACKAGES for path in (compiled.PROJECT / name).rglob("*.py")]
    assert files
    assert [path for path in files if "fastmath=" in path.read_text()] == []
