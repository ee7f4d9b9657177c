"""Cost of a query to a journal with weeks of runs from a busy line.

    python -m tests.bench.records [RUNS]    100,000 runs if not given

The product simulates and records a few runs. Copies of their rows with other times and serial numbers then fill the
journal, one run every 15 s. Each query is a separate process, as for a technician.
"""

import csv
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np

from cell.page.records import Records
from cell.records.index import Index
from cell.records.journal import Journal
from cell.records.run_query import RunQuery
from cell.records.schema import EventRow, RunRow, StageRow
from drivers.errors import FaultCode

LIMIT = 1.0
"""Longest duration of a query, s."""
PERIOD = 15.0
"""Time between two runs of the line, s."""
MADE: tuple[tuple[str, ...], ...] = (
    ("--set", "sim.seed=1"),
    ("--set", "sim.seed=2", "--set", "sim.plate.present=false", "--set", "search.timeout=2.0"),
    ("--set", "sim.seed=3", "--set", "limits.force=6.0"),
)
"""Options of `cell run insert_peg` for each simulated run: a good one, one without a hole, and a fault."""
FAULT = FaultCode.TRACKING
"""Fault that ends the last of them."""
REPEATS = 5
"""Number of repetitions of each query."""
BATCH = 2000
"""Number of runs in one write."""


@dataclass(frozen=True, slots=True)
class Made:
    """One recorded run with all its records."""

    row: RunRow
    stages: Sequence[StageRow]
    events: Sequence[EventRow]


@dataclass(frozen=True, slots=True)
class QuestionLine:
    """Result of one query."""

    question: str
    runs: int
    """Number of recorded runs."""
    time: float
    """Median time from the command to the first output, s."""
    worst: float
    """Longest time, s."""
    answer: float
    """Median processor time until then, s; other work on the computer hardly changes it."""
    whole: float
    """Median processor time of the whole command, including the files that it draws, s."""
    asked: int

    @property
    def holds(self) -> bool:
        """True if the processor time until the first output is within the limit."""
        return self.answer <= LIMIT


def fill(folder: Path, runs: int, done: Callable[[int], None], kinds: Sequence[Sequence[str]] = MADE) -> None:
    """Simulate a few runs, and fill their journal with copies up to a number of runs.

    Args:
        folder: Folder of the journal.
        runs: Final number of runs.
        done: Called with the number of added runs.
        kinds: Options of the simulated runs; most copies are of the first.

    Raises:
        RuntimeError: A run has no record.
    """
    for options in kinds:
        command = [sys.executable, "-m", "cell", "run", "insert_peg", "--journal", str(folder), *options]
        subprocess.run([*command, "--set", "sim.pace=max"], capture_output=True, check=False)
    made = _made(folder)
    if len(made) != len(kinds):
        raise RuntimeError(f"{folder}: {len(made)} of {len(kinds)} runs on record")
    rng, first = np.random.default_rng(runs), datetime.now(UTC) - timedelta(seconds=PERIOD * runs)
    index = Index(folder, is_read_only=False)
    try:
        for begin in range(len(made), runs, BATCH):
            end = min(begin + BATCH, runs)
            with index.at_once():
                for number in range(begin, end):
                    # Nine of ten runs are good, as on a line that needs attention.
                    kind = 0 if rng.random() < 0.9 else int(rng.integers(1, len(made)))
                    _put(index, made[kind], number + 1, first + timedelta(seconds=PERIOD * number), rng)
            done(end - begin)
    finally:
        index.close()
    with Journal(folder, is_read_only=True) as journal:
        shutil.copyfile(journal.samples_path(1), journal.samples_path(shown(runs)))


def shown(runs: int) -> int:
    """Return the number of the run to query by number, the only copy with samples."""
    return runs // 2


def questions(runs: int, drawn: Path) -> dict[str, tuple[str, ...]]:
    """Return the arguments of each query's command, by name; `drawn` is the file of a report, without its ending."""
    run = shown(runs)
    return {
        "runs": ("runs",),
        "runs --since 1d --outcome failure": ("runs", "--since", "1d", "--outcome", "failure"),
        f"runs --fault {FAULT:d} --last 1000": ("runs", "--fault", str(int(FAULT)), "--last", "1000"),
        "runs --part SERIAL": ("runs", "--part", f"SN{run:07d}"),
        "show RUN": ("show", str(run)),
        "compare RUN RUN": ("compare", str(run), str(run + 1)),
        "runs --since 1d --export parquet": ("runs", "--since", "1d", "--export", "parquet", "--out", f"{drawn}-runs"),
        "faults CODE": ("faults", str(int(FAULT))),
        "report --since 1d": ("report", "--since", "1d"),
        "report --since 7d": ("report", "--since", "7d"),
        "report": ("report",),
        "report --out HTML": ("report", "--out", f"{drawn}.html"),
        "report --out PDF": ("report", "--out", f"{drawn}.pdf"),
    }


def measure(
    folder: Path, runs: int, times: int, done: Callable[[], None], asked: Mapping[str, Sequence[str]]
) -> list[QuestionLine]:
    """Run all queries on a journal, including those of its page.

    Args:
        folder: Folder of the journal.
        runs: Number of runs in it.
        times: Number of repetitions of each query.
        done: Called after every query.
        asked: Arguments of each query's command, by name.
    """
    lines = []
    for name, arguments in asked.items():
        words = arguments if arguments[0] == "faults" else (*arguments, "--journal", str(folder))
        took, answer, whole = zip(*(_asked(words) for _ in range(times)), strict=True)
        lines.append(QuestionLine(name, runs, median(took), max(took), median(answer), median(whole), times))
        done()
    records = Records(folder)
    for name, ask in (("page: summary", records.summary), ("page: a run", lambda: records.whole(shown(runs)))):
        spent = [_spent(ask) for _ in range(times)]
        lines.append(QuestionLine(name, runs, median(spent), max(spent), median(spent), median(spent), times))
        done()
    return lines


def _spent(ask: Callable[[], object]) -> float:
    """Return the processor time of a query from the page's own thread, s."""
    began = time.thread_time()
    ask()
    return time.thread_time() - began


def _made(folder: Path) -> list[Made]:
    with Journal(folder, is_read_only=True) as journal:
        rows = reversed(journal.select(RunQuery()))
        return [Made(row, journal.stages(row.run), journal.events(run=row.run)) for row in rows]


def _put(index: Index, made: Made, run: int, started: datetime, rng: np.random.Generator) -> None:
    """Write a copy of a run with another number, part and time."""
    stretch = float(np.exp(0.2 * rng.normal()))
    cycle = made.row.cycle_time
    ended = started + timedelta(seconds=stretch * (cycle or 0.0))
    row = replace(
        made.row,
        run=run,
        serial=f"SN{run:07d}",
        started=started.isoformat(timespec="milliseconds"),
        ended=ended.isoformat(timespec="milliseconds"),
        cycle_time=None if cycle is None else stretch * cycle,
    )
    index.put(row)
    index.put_ended(
        row,
        [replace(stage, run=run, began=stretch * stage.began, ended=stretch * stage.ended) for stage in made.stages],
    )
    for event in made.events:
        index.put(replace(event, run=run, time=started.isoformat(timespec="milliseconds")))


def _asked(arguments: Sequence[str]) -> tuple[float, float, float]:
    """Return the time from a command to its first output, its processor time until then, and its total processor time,
    s.

    Raises:
        RuntimeError: The command failed.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command, began = [sys.executable, "-m", "cell", *arguments], time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as process:
        assert process.stdout is not None
        process.stdout.read(1)
        took = time.perf_counter() - began
        answered = _processor_time(process.pid)
        process.stdout.read()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        whole = _processor_time(process.pid)
    if process.returncode != 0:
        raise RuntimeError(f"cell {' '.join(arguments)}: exit status {process.returncode}")
    return took, answered, whole


def _processor_time(process: int) -> float:
    """Return the processor time of a process so far, s; a process that has just ended is permitted."""
    values = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(values[11]) + int(values[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Fill a journal, run the queries, and print a row for each."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    with TemporaryDirectory() as folder:
        fill(Path(folder), runs, lambda count: None)
        lines = measure(Path(folder), runs, REPEATS, lambda: None, questions(runs, Path(folder) / "report"))
    table = csv.DictWriter(sys.stdout, [*asdict(lines[0]), "holds"])
    table.writeheader()
    table.writerows(asdict(line) | {"holds": line.holds} for line in lines)


if __name__ == "__main__":
    main()
