"""The commands of docs/first-day.md on the desk, typed by a person who knows that page alone."""

import os
import pty
import queue
import re
import shlex
import signal
import subprocess
import threading
import time
from datetime import date
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip(
    "franka_sim", reason="needs the packages that tests/franka/simulated.py names", exc_type=ImportError
)

from cell.calibrate.proven import FACTS, FILE, keep, missing, read
from cell.config.load import load
from drivers.frames import end_point
from drivers.parts import PLATE_BORDER
from plc_bridge.peer import Peer
from tests.emulation import emulated_or_skip
from tests.franka.desk import CONFIG, desk
from tests.line.test_commissioning import act

pytestmark = [pytest.mark.alone, pytest.mark.timeout(20000)]

PAGE = Path("docs/first-day.md").read_text(encoding="utf-8")
ASKS = re.compile(r"(finger|let it go|Enter|Keys|/9 [a-z ]+): ")
"""End of a request; a progress bar may follow it at once."""
MINUTES = 0.05
"""Duration of the measurement of the loop in place of ten minutes, min."""
PUSH = 15.0
"""Force of a finger, N."""
TAP = 0.25
"""Time between two taps of a key, s."""
WAY = 4e-3
"""Way of the tool at one tap, m."""
LOOK = 12.0
"""Time from the start of `cell skin` or `cell serve` to Ctrl-C, s."""
CYCLE = 0.02
"""Time between two cycles of the PLC, s of wall time."""
OVER = np.array([0.0, 0.0, 0.1])
"""Way from a place to the point above it, m, base frame."""


def commands(step):
    (section,) = re.findall(rf"^## {step}\. .*?(?=^## )", PAGE, re.MULTILINE | re.DOTALL)
    return re.findall(r"^cell .*$", section, re.MULTILINE)


class Plc(threading.Thread):
    """Acts as `cell check --plc` requests of a PLC, and cycles meanwhile."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self._cell, self.asked = Peer("127.0.0.1", port), queue.SimpleQueue()

    def run(self):
        step = self.asked.get()
        while step != "return":
            act(self._cell, step)
            while self.asked.empty() and step != "loss":
                self._cell.cycle()
                time.sleep(CYCLE)
            step = self.asked.get()
        act(self._cell, step)
        self._cell.close()


class Person:
    """Types commands, answers their requests, and enters the lines that they print."""

    def __init__(self, boards):
        self.boards = boards

    def wait(self, seconds):
        end = self.boards.world.now() + seconds
        while self.boards.world.now() < end:
            time.sleep(0.005)

    def do(self, line):
        """Run a command in a terminal of its own, and return its status."""
        answers = {"--prove": self.prove, "teach": self.show, "skin": self.turn, "--plc": self.operate}
        answer = next((does for word, does in answers.items() if word in line.split()), None)
        near, far = pty.openpty()
        began, simulated, text, answered = time.monotonic(), self.boards.world.now(), "", 0
        environment = {**self.boards.environment, "TERM": "dumb", "COLUMNS": "200"}
        with subprocess.Popen(
            shlex.split(line), stdin=far, stdout=far, stderr=far, cwd=self.boards.folder, env=environment
        ) as run:
            os.close(far)
            if line.startswith(("cell skin", "cell serve")):
                self.wait(LOOK)
                run.send_signal(signal.SIGINT)
            while printed := _read(near):
                text += printed
                if answer and (found := ASKS.search(text, answered)):
                    asked, answered = text[answered : found.end()], found.end()
                    answer(asked, lambda keys: os.write(near, keys.encode()))
        os.close(near)
        self.leave("push")
        wall, world = time.monotonic() - began, self.boards.world.now() - simulated
        print(
            f"{text}\n{line}: status {run.returncode}, {world:.0f} s of the cell, {wall:.0f} s of wall time", flush=True
        )
        _, _, lines = text.replace("\r\n", "\n").partition("for the cell's file")
        if "\n\n[" in lines:
            self.boards.write(lines.partition(":\n\n")[2])
        return run.returncode

    def operate(self, asked, keys):
        if "/9 connection" in asked:
            self.plc = Plc(load(self.boards.folder / "cell_01.toml").cell.plc.modbus.port)
            self.plc.start()
        self.plc.asked.put(asked.rpartition("/9 ")[2].removesuffix(": "))

    def act(self, name, content=""):
        (self.boards.folder / name).write_text(content, encoding="utf-8")

    def leave(self, name):
        (self.boards.folder / name).unlink(missing_ok=True)

    def prove(self, asked, keys):
        keys("\n")
        self.wait(1.0)
        if "push" in asked:
            self.act("push", f"0 {PUSH} 0")
        else:
            self.leave("push")
            self.act("lever")
            self.wait(0.5)
            self.leave("lever")

    def turn(self, asked, keys):
        angle = re.search(r"to ([+-]\d+) degrees", asked)
        if angle:
            self.act("rod", angle[1])
        else:
            self.leave("rod")
        keys("\n")

    def show(self, asked, keys):
        """Show every place with the end of a peg, and write them."""
        self.act("empty")
        middle, first = np.array(CONFIG.hole.centre), np.array(CONFIG.rack.first)
        area = np.array([*CONFIG.hole.area, 0.0]) / 2.0
        edge = area + np.array([PLATE_BORDER, PLATE_BORDER, 0.0]) / 2.0
        for key, place in [
            ("1", first),
            ("b", np.array(CONFIG.recover.bin)),
            ("p", middle - edge),
            ("h", middle - area),
            ("h", middle + area),
            ("p", middle + edge),
        ]:
            self.go(place + OVER, keys)
            self.go(place, keys)
            self.wait(1.0)
            keys(key)
            self.wait(0.5)
            self.go(self.end() + OVER, keys)
        keys("w")
        self.leave("empty")

    def end(self):
        return end_point(self.boards.world.world.tcp(), 0.0, CONFIG.peg.length)[0]

    def go(self, place, keys):
        """Push the hand until the peg's end is close to a place, then move it there by keys."""
        while (apart := float(np.linalg.norm(place - self.end()))) > 0.03:
            force = PUSH * (place - self.end()) / apart
            self.act("push", " ".join(f"{value:.3f}" for value in force))
            self.wait(0.02)
        self.leave("push")
        self.wait(1.0)
        while np.abs(left := place - self.end()).max() > 0.75 * WAY:
            axis = int(np.abs(left).argmax())
            keys("xyzXYZ"[axis + 3 * (left[axis] < 0.0)])
            self.wait(TAP)


def _read(end):
    try:
        return os.read(end, 4096).decode(errors="replace")
    except OSError:  # the other end is closed
        return ""


@pytest.fixture
def person(tmp_path):
    emulated_or_skip()
    with desk(8, tmp_path) as boards:
        yield Person(boards)


def follow(person, steps):
    """Type every command of some steps; each but the measurement of the loop must succeed."""
    began = time.monotonic()
    for line in (line for step in steps for line in commands(step)):
        if "--loop" in line:  # its verdict depends on this computer
            person.do(line.replace("--loop 10", f"--loop {MINUTES}"))
        else:
            assert person.do(line.replace("192.168.0.10", "127.0.0.1")) == 0, line
    now = person.boards.world.now()
    print(
        f"steps {list(steps)} of the first day: {now:.0f} s of the cell, {time.monotonic() - began:.0f} s of wall time"
    )


def test_a_new_cell_is_proven_by_the_commands_of_the_first_day(person):
    follow(person, range(7, 9))
    proven = read(person.boards.folder / "calibration" / FILE)
    assert missing(load(person.boards.folder / "cell_01.toml").cell, proven) == ["places"]


def test_a_plc_is_put_into_service_by_the_commands_of_the_first_day(person):
    config = load(person.boards.folder / "cell_01.toml").cell
    keep(person.boards.folder / "calibration" / FILE, config, dict.fromkeys(FACTS, "measured"), date.today())
    follow(person, [12])


@pytest.mark.by_hand
def test_a_person_who_follows_the_page_inserts_the_first_peg(person):
    follow(person, range(1, 13))
    truth = person.boards.world.world.truth()
    assert truth.switch_closed
    assert not truth.is_void
