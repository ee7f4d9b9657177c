"""The technician's commands: exit statuses, and one line for every error."""

import csv
import json
import shlex
from contextlib import closing
from dataclasses import fields

import pytest

from cell.commands import map as map_command
from cell.commands.cli import FAULT, GOOD, NOT_GOOD, WRONG_USE, main
from cell.config.files import DEFAULT
from cell.config.keys import in_force
from cell.config.load import load
from cell.config.text import as_toml
from cell.lab import demo
from drivers.errors import FAULTS
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Diagnostics
from tests.emulation import emulated_or_skip
from tests.plc_lines import patient
from tests.quick_cell import quick_cell

REAL = DEFAULT.parent / "cell_01.toml"
"""Config of a physical cell."""
AFAR = "--connect 127.0.0.1:5020"
SKIN = "skin --set sim.pace=max --set reality.scale=0"
CAN, SERIAL = f"{SKIN} --set skin.kind=can", f"{SKIN} --set skin.kind=serial"
WRONG = [
    ("check --set peg.diametre=0.008", "peg.diametre: unknown key"),
    ("check --config no_such_cell.toml", "no_such_cell.toml"),
    ("trials --out never --set peg.diameter=0.0082", "thicker than the hole"),
    ("run juggle", "juggle"),
    ("run reset", "run reset: only with --connect HOST:PORT"),
    ("run spray_search --set search.speed=3", "search.speed = 3"),
    (f"run spray_search {AFAR} --set search.speed=3", "search.speed"),
    (f"run spray_search {AFAR} --set peg.diameter=0.008", "peg.diameter"),
    ("check --minutes 5", "--minutes: no such option"),
    ("run insert_peg --recipe 999", "999"),
    ("watch --connect localhost", "localhost"),
    ("demo --trials 0", "--trials"),
    (f"demo --config {REAL}", ""),
    ("dance", " allowed\n"),  # no command is similar
    ("", ""),
    ("map --format pdf", "pdf"),
    (f"demo --out {DEFAULT}", str(DEFAULT)),
    ("alarms --since yesterday", "--since yesterday: 30m, 12h"),
    ("alarms --until 2025-13-01", "--until 2025-13-01: 30m, 12h"),
    ("report --since 1d --until 2d", "--until 2d: not after --since 1d"),
    ("runs --since 2025-01-02 --until 2025-01-02", "not after --since 2025-01-02"),
    ("compare --since 7d --with 1d", "--since 7d: not after --with 1d"),
    ("compare 1 2 --since 7d", "compare: two runs (RUN RUN) or two periods"),
    ("alarms --fault 9999", "--fault 9999: no such name"),
    ("faults 9999", "fault 9999: no such code; "),
    ("report --shifts 25:00", "'25:00': times of a day"),
    (f"{SKIN} --replay no_such_file", "cannot be read"),
    (f"{SKIN} --replay {__file__}", "no recording"),
    (f"{SKIN} --record traffic", "skin.record: unknown key; dead_modules, "),
    (f"{CAN} --set skin.board.kind=ican", '"cyskin", "icub" allowed'),
    (f"{SERIAL} --set skin.board.wire.crc.polynomial=6", "makes the lowest bit of every check sum 0"),
    (f"{CAN} --out /proc/picture.png", "cannot be written"),
    ("calibrate places --pegs 5 --set rack.refill=asked", "--pegs 5: 2 to 4 allowed"),
    ("calibrate places --pegs 1", "--pegs 1: 2 to 20 allowed"),
    ("calibrate places --set rack.slots=1 --set rack.refill=asked", "rack.slots = 1: two pegs needed"),
    ("calibrate arm --pegs 2", "--pegs: only for places"),
    (f"check --simulate arm,skim --config {REAL}", "skim: no such name; arm, gripper, skin, switch allowed"),
    (f"check --simulate '' --config {REAL}", "device : no such name"),
    (f"check --simulate skin --config {REAL}", 'skin.kind = "sim": needs a simulated arm'),
    (f"check --simulate arm --config {REAL}", 'gripper.kind = "franka": needs the real arm'),
    (f"check --only skim --config {REAL}", "device skim: no such name"),
    (f"check --only skin --prove --config {REAL}", "--only: not together with"),
    (f"trials --out x --config {REAL}", 'arm.kind = "franka"'),
    (f"study modelling --out x --config {REAL}", 'arm.kind = "franka"'),
    ("study contact --soak 1", "--soak"),
    ("study frontier --quick --method shiped --out .", "shipped"),
    ("study frontier --quick --scene firm --out .", "firm grip"),
]
"""Wrong command lines, and a part of the one-line answer to each."""


@pytest.mark.parametrize(("words", "said"), WRONG, ids=[words.replace(" ", "_") for words, _ in WRONG])
def test_wrong_use_is_answered_in_one_line(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(words)) == WRONG_USE
    line = capsys.readouterr().err
    assert (line.count("\n"), said in line) == (1, True), line
    assert list(tmp_path.iterdir()) == []


PHYSICAL = ["--config", str(REAL), "--set", "plc.modbus.port=0"]
NOWHERE = [word for device in ("arm", "gripper") for word in ("--set", f"{device}.host=127.254.254.254")]


def test_every_fault_of_the_check_names_its_step_of_the_first_day(capsys):
    assert main(["check", *PHYSICAL, *NOWHERE, "--json"]) == FAULT
    found = {line["device"]: line["found"] for line in json.loads(capsys.readouterr().out)}
    for name, step in (("arm", 2), ("gripper", 4), ("skin", 5), ("switch", 6)):
        assert found[name].endswith(f"; docs/first-day.md, step {step}")
        assert "\n" not in found[name]
    assert found["proven"].startswith("ok, but in commissioning: wrench, end effector, load, switch, places not proven")


def test_a_physical_cell_without_a_simulated_world_is_asked_where_its_arm_is(tmp_path, capsys):
    (tmp_path / "cell.toml").write_text(
        as_toml(each for each in in_force(load(REAL)) if each.key.name.split(".")[0] not in ("sim", "contact", "grip"))
    )
    assert main(["where", "--config", str(tmp_path / "cell.toml"), *NOWHERE]) == FAULT
    assert "fault 1007: arm" in capsys.readouterr().err


def test_no_plc_is_commissioned_before_the_cell_is_proven(capsys):
    assert main(["check", *PHYSICAL, "--plc", "127.0.0.1"]) == WRONG_USE
    assert "--plc: in commissioning: " in capsys.readouterr().err


def test_a_silent_cell_and_a_defect_are_faults_in_one_line(capsys, monkeypatch):
    monkeypatch.setattr(map_command, "run", lambda args: 1 / 0)
    for words, said in ((["watch", "--connect", "127.0.0.1:1", "--once"], "127.0.0.1:1"), (["map"], "division")):
        assert main(words) == FAULT
        line = capsys.readouterr().err
        assert (said in line, line.count("\n")) == (True, 1), line


@pytest.mark.parametrize(
    ("port", "said", "status"),
    [
        ("/dev/no-such-port", "no such port", FAULT),
        ("/dev/null", "/dev/null", FAULT),
        ("emulated", "ok", GOOD),
    ],
)
def test_check_names_the_fault_of_the_switch(capsys, port, said, status):
    if port == "emulated":
        emulated_or_skip()
    sets = [f"switch={{kind='serial', port='{port}'}}", "sim.pace=max", "plc.modbus.port=0"]
    assert main(["check", "--json", *(word for text in sets for word in ("--set", text))]) == status
    found = {entry["device"]: entry["found"] for entry in json.loads(capsys.readouterr().out)}
    assert said in found["switch"]


def test_faults_lists_every_code(capsys):
    assert main(["faults", "--json"]) == GOOD
    assert [entry["code"] for entry in json.loads(capsys.readouterr().out)] == list(FAULTS)


MEANINGS = ("4 IDLE", "2 spray_search", "3 NO_HOLE", "5 NOT_HOLDER", "101 grasp_from_rack")


@pytest.mark.parametrize(("form", "words"), [("md", MEANINGS), ("csv", ()), ("json", ()), ("eds", ())])
def test_the_map_comes_in_each_form_with_the_meaning_of_every_number(capsys, form, words):
    assert main(["map", "--format", form]) == GOOD
    out = capsys.readouterr().out
    assert all(word in out for word in ("report_sequence", "command_life", *words))


@pytest.fixture
def address(served):
    """Return HOST:PORT of a cell of fakes that is served until the test ends."""
    return "{}:{}".format(*served.bridge.address)


@pytest.fixture
def watched(address, capsys):
    """Return a function that returns what `watch` shows of it once."""

    def watched():
        capsys.readouterr()
        main(["watch", "--once", "--json", "--connect", address])
        return json.loads(capsys.readouterr().out)

    return watched


def test_a_served_cell_runs_a_skill_and_is_stopped_and_reset(address, watched, capsys):
    assert main(["run", "grasp_from_rack", "--connect", address, "--json", "--set", "grasp.force=12.5"]) == GOOD
    assert json.loads(capsys.readouterr().out)["result"] == "success"
    assert main(["run", "stop", "--connect", address]) == GOOD
    assert main(["run", "reset", "--connect", address]) == GOOD
    assert watched()["state"] == "IDLE"


def test_watch_shows_refusals_and_every_count(address, watched, capsys):
    assert main(["run", "unhold", "--connect", address]) == NOT_GOOD
    seen = watched()
    assert (seen["refusal"], seen["diagnostics"]["refusals"]) == ("not_ready", 1)
    assert set(seen["diagnostics"]) == {column.name for column in fields(Diagnostics)}
    main(["watch", "--once", "--connect", address])
    line = capsys.readouterr().out
    assert all(f"{name}=" in line for name in ("refusal", "refusals", "lost", "malformed", "unauthorised"))


def test_watch_takes_over_nothing_from_a_plc_of_the_same_host(served, watched):
    with closing(Peer(*served.bridge.address)) as plc:
        plc.connect()
        assert plc.take()
        plc.trigger(99)
    holder = watched()["holder"]
    with closing(Peer(*served.bridge.address)) as plc:
        plc.look()
        assert plc.read_report().holder == holder != ""


def test_the_journal_shows_a_run_with_its_picture_and_samples(loaded, capsys, tmp_path):
    folder = tmp_path / "journal"
    with quick_cell(loaded, patient(), folder) as cell:
        main(["run", "grasp_from_rack", "--connect", "{}:{}".format(*cell.bridge.address)])
    capsys.readouterr()
    assert main(["runs", "--json", "--journal", str(folder)]) == GOOD
    (row,) = json.loads(capsys.readouterr().out)
    assert row["outcome"] == "success"
    assert main(["show", str(row["run"]), "--journal", str(folder), "--export", str(tmp_path / "out")]) == GOOD
    picture, samples = sorted((tmp_path / "out").iterdir(), reverse=True)
    assert picture.read_bytes().startswith(b"\x89PNG")
    with samples.open() as file:
        assert {row["stage"] for row in csv.DictReader(file)} == {"1.0"}


def test_no_demo_without_a_port(capsys, address, tmp_path):
    port, folders = address.rpartition(":")[2], ("--out", str(tmp_path), "--journal", str(tmp_path / "runs"))
    assert main(["demo", "--set", f"plc.modbus.port={port}", *folders]) == FAULT
    assert port in capsys.readouterr().err
    assert not (tmp_path / demo.CHART).exists()
