"""`cell check`: open and read every device of a config once; with --plc, commission cell and PLC together."""

import argparse
import json
from contextlib import suppress
from dataclasses import asdict
from datetime import date, datetime
from pathlib import Path

from cell.calibrate.commissioning import Walk, WatchedLine, record
from cell.calibrate.proofs import prove_switch, prove_wrench
from cell.calibrate.proven import commissioning, in_force, keep, read
from cell.commands.arguments import add_cell, devices, file_path, load_config, open_journal, out_folder, proven_file
from cell.commands.terminal import FAULT, GOOD, NOT_GOOD, ask, complain, filled, say, show
from cell.commands.warm_up import warm_up
from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import assemble, check, loop_figures, opened
from cell.devices.checks import OK, loop_verdict
from cell.devices.computer import computer
from cell.records.provenance import PROGRAM, installed
from cell.run.exposure import exposures, key_days, key_verdict
from cell.run.line import PROGRAMS
from cell.run.supervisor import Supervisor
from drivers.errors import CellError, ConfigError, DeviceNotOpenedError, NotCalibratedError
from drivers.figures_file import read_toml, write_whole
from plc_bridge.bridge import Bridge
from plc_bridge.config import PlcConfig

STEPS = {
    **dict.fromkeys(("kernel", "memlock", "priority", "governor", "clock"), 1),
    **dict.fromkeys(("arm", "system", "thresholds"), 2),
    **dict.fromkeys(("gripper", "end effector", "load"), 4),
    "skin": 5,
    "switch": 6,
    "proven": 8,
}
"""Step of docs/first-day.md that repairs a fault, by name of the check."""
LAST_STEP = 12
"""Step of the first day that connects the PLC."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --config, --set and the options of commissioning."""
    add_cell(parser)
    parser.add_argument(
        "--only", type=devices, default=(), metavar="DEVICES", help="check these devices alone: arm,gripper,skin,switch"
    )
    parser.add_argument(
        "--prove",
        action="store_true",
        help="with a person at the arm: prove wrench, hand, load and switch, and store the proof",
    )
    loop = "measure the arm's 1 kHz loop for M minutes while the arm holds still; default 10"
    parser.add_argument("--loop", type=float, nargs="?", const=10.0, metavar="M", help=loop)
    parser.add_argument(
        "--plc", metavar="HOST", help='address of the PLC that will connect, "node 1" on CAN, "rtu:ttyUSB0" on a line'
    )
    parser.add_argument(
        "--name", default="", metavar="NAME", help="name of the person who commissions, for the record of --plc"
    )
    parser.add_argument("--out", type=file_path, metavar="FILE", help="file for the record of --plc, JSON")


def run(args: argparse.Namespace) -> int:
    """Open each device and the bridge's sockets, or run the commissioning; return GOOD if all checks pass."""
    loaded = _loaded(args)
    if args.loop is not None:
        return _loop(args, loaded)
    return _check(args, loaded) if args.plc is None else _commission(args, loaded)


def _loaded(args: argparse.Namespace) -> LoadedConfig:
    """Return the config; require options that go together and fit the cell."""
    needs_arm = args.prove or args.loop is not None
    if args.plc is None and (args.name or args.out is not None):
        raise ConfigError("--name, --out: only with --plc HOST")
    if args.only and (args.plc or needs_arm):
        raise ConfigError("--only: not together with --plc, --prove or --loop, which need the whole cell")
    loaded = load_config(args)
    if loaded.cell.is_simulated and needs_arm:
        raise ConfigError('--prove, --loop: arm.kind = "sim": only for a physical cell')
    return loaded


def _check(args: argparse.Namespace, loaded: LoadedConfig) -> int:
    if args.only:
        return _report(args, check(assemble(loaded.cell), args.only))
    found = _computer(loaded) + check(assemble(loaded.cell))
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    try:
        bridge.start()
        found.append(("plc", OK))
    except CellError as error:
        found.append(("plc", f"fault {error.code.value}: {error}"))
    finally:
        bridge.close()
    found += _network(loaded.cell.plc) + _proven(args, loaded, dict(found))
    return _report(args, found)


def _report(args: argparse.Namespace, found: list[tuple[str, str]]) -> int:
    """Show the verdicts, each fault with the step that repairs it; return GOOD if there is no fault."""
    found = [
        (name, text if text.startswith(OK) else f"{text}; docs/first-day.md, step {STEPS.get(name, LAST_STEP)}")
        for name, text in found
    ]
    data = [{"device": name, "found": text} for name, text in found]
    status = GOOD if all(text.startswith(OK) for _, text in found) else FAULT
    return show(args, filled(("device", "found"), found), data, status)


def _computer(loaded: LoadedConfig) -> list[tuple[str, str]]:
    """Return the verdicts on this computer, if the arm needs real time, and the dates of the calibrations."""
    config, files = loaded.cell, loaded.cell.calibration
    if config.is_simulated:
        return []
    found = computer() if config.is_realtime else []
    for name, path in (("skin", files.skin), ("arm", files.arm)):
        text = f"{OK}, but nothing is calibrated: `cell calibrate {name}`"
        if path is not None:
            text = f"{OK}, of {read_toml(path)['date']}"  # its age was checked before
        found.append((f"calibration.{name}", text))
    return found


def _proven(args: argparse.Namespace, loaded: LoadedConfig, found: dict[str, str]) -> list[tuple[str, str]]:
    """Return the verdict on the proven facts of a physical cell; with --prove, prove them first."""
    if loaded.cell.is_simulated:
        return []
    path = proven_file(args)
    if args.prove:
        try:
            _prove(loaded, path, found)
        except (CellError, ConfigError) as error:
            return [("proven", str(error))]
    why = commissioning(loaded.cell, read(path))
    return [("proven", f"{OK}, but {why}" if why else OK)]


def _prove(loaded: LoadedConfig, path: Path, found: dict[str, str]) -> None:
    """Prove the sign of the wrench, end effector, load and switch, and store each fact.

    Raises:
        CellError: A device is not usable, a fact could not be proven, or the sign of the wrench is reversed.
    """
    needed = ("arm", "gripper", "end effector", "load", "switch")
    wrong = [name for name in needed if not found.get(name, "").startswith(OK)]
    if wrong:
        raise NotCalibratedError(f"nothing proven: first repair {', '.join(wrong)}")
    out_folder(path.parent)  # made now, so that no proof is lost
    measured = {name: found[name] for name in ("end effector", "load")}
    with opened(assemble(loaded.cell), "arm") as cell:
        measured["wrench"] = prove_wrench(cell, ask)
    with opened(assemble(loaded.cell), "switch") as cell:
        measured["switch"] = prove_switch(cell, ask)
    keep(path, loaded.cell, measured, date.today())


def _loop(args: argparse.Namespace, loaded: LoadedConfig) -> int:
    """Hold the arm still and print the times of its 1 kHz loop; return GOOD if `loop_verdict` is ok."""
    figures = loop_figures(loaded.cell, 60.0 * args.loop, args.stop)
    told = loop_verdict(figures)
    title = f"{figures.cycles} cycles, {figures.missed} missed: {told}"
    measured = (("between two states", figures.spacing), ("from state to torques", figures.busy))
    rows = [(name, *(f"{1e3 * value:.3f}" for value in asdict(times).values())) for name, times in measured]
    table = filled(("time (ms)", "p50", "p99", "p99.9", "largest"), rows, title=title)
    return show(args, table, {**asdict(figures), "found": told}, GOOD if told.startswith(OK) else FAULT)


def _network(plc: PlcConfig) -> list[tuple[str, str]]:
    """Return the open ports and the remaining validity of each key."""
    found = [("network", f"{OK}, but {line}") for line in exposures(plc)]
    with suppress(DeviceNotOpenedError):  # already in the report of the bridge
        found += [(name, key_verdict(days)) for name, days in key_days(plc.tls).items()]
    return found


def _commission(args: argparse.Namespace, loaded: LoadedConfig) -> int:
    """Serve the cell to the PLC and watch its commands until every step has passed or one has failed."""
    if why := in_force(loaded, proven_file(args))[1]:
        raise ConfigError(f"--plc: {why}")
    if args.out is not None:
        out_folder(args.out.parent)  # made now, so that no record of a whole commissioning is lost
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    # Longest time for one step of the commissioning, s.
    walk = Walk(args.plc, loaded.cell.plc.life_timeout, 300.0, complain if args.json else say)
    line = WatchedLine(bridge, walk, args.stop)
    with open_journal(args, loaded.cell.journal) as journal, opened(assemble(warm_up(loaded))) as cell:
        supervisor = Supervisor(cell, loaded, line, journal, args.stop)
        supervisor.scan()
        bridge.start()
        try:
            line.begin()
            supervisor.serve()
        finally:
            bridge.close()
    found = record(walk, args.name, datetime.now().astimezone().isoformat(timespec="seconds"), installed(PROGRAM))
    status = show(args, _sheet(found), found, GOOD if found["passed"] else NOT_GOOD)
    if args.out is not None:
        write_whole(args.out, json.dumps(found, indent=2) + "\n", "record")
    return status


def _sheet(found: dict[str, object]) -> str:
    """Return the printable record, with a line for the signature."""
    steps = found["steps"]
    assert isinstance(steps, list)
    head = [f"{key}: {found[key]}" for key in ("what", "date", "technician", "plc", "version", "map")]
    rows = [f"  {'passed' if each['passed'] else 'FAILED'}  {each['step']}: {each['measured']}" for each in steps]
    verdict = "PASSED" if found["passed"] else "NOT PASSED"
    return "\n".join([*head, *rows, verdict, "signed: ______________________"])
