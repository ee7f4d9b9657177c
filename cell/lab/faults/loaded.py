"""Importing this loads and compiles what a served cell needs: one insertion as fast as it goes, recorded and thrown away."""

import os
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

from cell.cli import load_command, main
from plc_bridge.bridge import Bridge
from plc_bridge.modbus import ModbusServer

USED = (load_command("serve"), Bridge, ModbusServer)

with (
    TemporaryDirectory() as folder,
    Path(os.devnull).open("w", encoding="utf-8") as nowhere,
    redirect_stdout(nowhere),
    redirect_stderr(nowhere),
):
    main(["run", "insert_peg", "--set", "sim.pace=max", "--journal", folder])
