"""The tests with the newest versions of all dependencies that `pyproject.toml` allows: `python -m tests.newest [PYTEST ARGUMENTS]`.

Run it once a week: a failure shows which bound has to be lower, before a customer who installs without `constraints.txt` meets it.
"""

import json
import subprocess
import sys
from pathlib import Path

FOLDER = Path("build/newest")
PYTHON = FOLDER / "bin" / "python"


def main(arguments: list[str]) -> int:
    """Install in a fresh environment, print what differs from the pins, and return the exit status of the tests."""
    subprocess.run(["uv", "venv", "-q", "--clear", "--python", sys.executable, str(FOLDER)], check=True)
    install = ["uv", "pip", "install", "-q", "--python", str(PYTHON), "--resolution", "highest", "-e", ".[dev]"]
    subprocess.run(install, check=True)
    told = subprocess.run(
        ["uv", "pip", "list", "--python", str(PYTHON), "--format", "json"], check=True, capture_output=True
    )
    pins = dict(line.split("==") for line in Path("constraints.txt").read_text().splitlines() if "==" in line)
    for package in json.loads(told.stdout):
        name, version = package["name"], package["version"]
        if (pin := pins.get(name, pins.get(name.replace("-", "_"), version)).partition(" ")[0]) != version:
            sys.stdout.write(f"{name} {version} instead of {pin}\n")
    sys.stdout.flush()
    return subprocess.run([str(PYTHON), "-m", "pytest", *arguments]).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
