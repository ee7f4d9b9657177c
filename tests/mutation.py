"""`python -m tests.mutation`: small faults in the modules that guard or command, drawn with a seed, and how many the tests notice.

mutmut makes the faults, as `[tool.mutmut]` in pyproject.toml says, and runs for each the tests beside the modules that reach
it. If names of faults follow the options, only these are tried.
"""

import argparse
import random
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

MUTMUT = Path(sys.executable).with_name("mutmut")
FOLDER = Path("mutants")
WANTED = 0.9
"""Least share of the faults that are to be noticed."""
UNNOTICED = ("survived", "no tests")
LINE = re.compile(r"^ +(\S+__mutmut_\d+): (.+)$", re.MULTILINE)
ATTEMPTS = 4
FIRST = "cell.run.states*"
"""Faults that are tried to let mutmut make all of them."""


def results() -> dict[str, str]:
    """Return what became of each fault, `not checked` where it was not tried."""
    told = subprocess.run([MUTMUT, "results", "--all", "true"], capture_output=True, text=True, check=True)
    return dict(LINE.findall(told.stdout))


def make(command: Sequence[str | Path]) -> None:
    """Let mutmut make the faults and see which test reaches which; a thread of the tests disturbs its count now and then."""
    for _ in range(ATTEMPTS - 1):
        if subprocess.run(command, check=False).returncode == 0:
            return
    subprocess.run(command, check=True)


def module_of(name: str) -> str:
    """Return the name of the module that contains a fault."""
    return name.rpartition(".")[0]


def drawn(names: Iterable[str], number: int, seed: int) -> list[str]:
    """Return so many faults of each module, or all where it has fewer."""
    by_module: dict[str, list[str]] = {}
    for name in sorted(names):
        by_module.setdefault(module_of(name), []).append(name)
    return [
        name
        for module, its in sorted(by_module.items())
        for name in sorted(random.Random(f"{seed} {module}").sample(its, min(number, len(its))))
    ]


def table(found: dict[str, str]) -> str:
    """Return how many faults of each module were noticed, and the names of the others."""
    tried, noticed = (
        Counter(map(module_of, found)),
        Counter(module_of(name) for name, ending in found.items() if ending not in UNNOTICED),
    )
    lines = [f"{module:28} {noticed[module]:4} of {tried[module]:4}" for module in sorted(tried)]
    lines.append(f"{'all':28} {noticed.total():4} of {tried.total():4}, {noticed.total() / tried.total():.0%}")
    return "\n".join([*lines, "", *(f"{ending}: {name}" for name, ending in found.items() if ending in UNNOTICED)])


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the faults; return 0 where enough of them were noticed, 1 where not."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--number", type=int, default=30, help="faults of each module")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args(arguments)
    if asked.number < 1:
        parser.error(f"--number {asked.number}: tries nothing; at least 1 allowed")
    run = [MUTMUT, "run", "--max-children", str(asked.workers)]
    names = asked.names
    if not names:
        shutil.rmtree(FOLDER, ignore_errors=True)
        make([*run, FIRST])
        names = drawn(results(), asked.number, asked.seed)
    subprocess.run([*run, *names], check=True)
    ended = results()
    found = {name: ended[name] for name in names}
    print(table(found))
    missed = sum(ending in UNNOTICED for ending in found.values())
    return int(missed > (1.0 - WANTED) * len(found))


if __name__ == "__main__":
    sys.exit(main())
