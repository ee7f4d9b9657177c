"""The quick campaign of faults, as CI runs it: `python -m tests.campaign [SEED]`.

All columns of `cell study faults` are printed, and its exit status is returned: 1 where a success was false, a run is not on record, a force was
above the bound or a cell did not insert again.
"""

import json
import subprocess
import sys
from pathlib import Path

SEED = "142001"
FOLDER = Path("build/faults")


def main(seed: str = SEED) -> int:
    """Run the campaign; return 1 where something happened that never may."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "cell", "study", "faults", "--quick", "--seed", seed, "--json"]
    with (FOLDER / "log.txt").open("w", encoding="utf-8") as log:
        found = subprocess.run([*command, "--out", str(FOLDER)], stdout=subprocess.PIPE, stderr=log)
    *_, line = json.loads(found.stdout)["kinds"]
    sys.stdout.write(", ".join(f"{name} {value}" for name, value in line.items()) + "\n")
    return found.returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
