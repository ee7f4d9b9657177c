"""`cell where`: print joint angles and tool pose of the arm."""

import argparse
import math

from rich.console import Group
from rich.table import Table

from cell.commands.arguments import add_config, load_config
from cell.commands.terminal import GOOD, show
from cell.devices.assembly import assemble, opened
from drivers.frames import end_point, quaternion


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --config and --set."""
    add_config(parser)


def run(args: argparse.Namespace) -> int:
    """Open only the arm, read it once, and print its pose."""
    config = load_config(args, default_pace="max").cell
    with opened(assemble(config), "arm") as cell:
        state = cell.arm.read()
    joints = config.arm_model().joints
    tip, _ = end_point(state.tcp, 0.0, config.peg.length)
    data = {
        "unit": config.arm_unit(),
        "q": state.q.tolist(),
        "position": state.tcp.position.tolist(),
        "quaternion": list(quaternion(state.tcp.rotation)),
        "tip": tip.tolist(),
        "force": state.wrench.force.tolist(),
    }
    table = Table("joint", "rad", "degrees", "least", "largest", title=config.arm_unit())
    for number, (q, low, high) in enumerate(zip(state.q, joints.q_min, joints.q_max, strict=True), 1):
        table.add_row(str(number), f"{q:.4f}", f"{math.degrees(q):.1f}", f"{low:g}", f"{high:g}")
    rows = (
        ("finger centre (m)", "position"),
        ("its quaternion, w x y z", "quaternion"),
        ("end of a straight peg (m)", "tip"),
    )
    pose = Table("tool", "base frame")
    for name, key in (*rows, ("force on the hand (N)", "force")):
        pose.add_row(name, "  ".join(f"{value:.4f}" for value in data[key]))

    show(args, Group(table, pose), data)
    return GOOD
