"""Importing this module loads and compiles all code of a served cell, by one insertion at full speed; its record is deleted."""

import os
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

from cell.commands.cli import load_command, main
from plc_bridge.bridge import Bridge
from plc_bridge.modbus.server import ModbusServer

USED = (load_command("serve"), Bridge, ModbusServer)

with (
    TemporaryDirectory() as folder,
    Path(os.devnull).open("w", encoding="utf-8") as nowhere,
    redirect_stdout(nowhere),
    redirect_stderr(nowhere),
):
    main(["run", "insert_peg", "--set", "sim.pace=max", "--journal", folder])
