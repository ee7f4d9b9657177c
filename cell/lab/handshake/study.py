"""`cell study handshake`: both ways to command the cell over Modbus, recorded and drawn."""

import argparse

from cell.commands.arguments import add_config, out_folder
from cell.lab.arguments import add_out, load_simulated
from cell.lab.report import StudyReport

SUMMARY = "the handshake by numbers and by coils, recorded on a socket and drawn as timing diagrams"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the config of the served cell, and the folder of the pictures."""
    add_config(parser)
    add_out(parser)


def run(args: argparse.Namespace) -> StudyReport:
    """Run both conversations with a cell in real time, draw them, and list every change."""
    from rich.table import Table

    from cell.lab.handshake import charts, recording

    loaded, folder = load_simulated(args, "study handshake", pace=None), out_folder(args.out)
    tables, data, files = [], [], []
    for trace, name in zip(recording.record(loaded), ("handshake", "coils"), strict=True):
        table = Table("time", "signal", "value", title=trace.title)
        for moment, signal, value in recording.transitions(trace):
            table.add_row(f"{moment:.3f} s", signal, str(value))
            data.append({"conversation": name, "time": moment, "signal": signal, "value": value})
        tables.append(table)
        files.append(folder / f"{name}.png")
        charts.draw(trace, files[-1])
    return StudyReport(tables, data, files)
