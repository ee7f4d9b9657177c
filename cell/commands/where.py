"""`cell where`: print joint angles and tool pose of the arm."""

import argparse
import math

from rich.console import Group

from cell.commands.arguments import add_config, load_config
from cell.commands.terminal import filled, show
from cell.devices.assembly import assemble, opened
from drivers.frames import end_point, quaternion


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --config and --set."""
    add_config(parser)


def run(args: argparse.Namespace) -> int:
    """Open only the arm, read it once, and print its pose."""
    config = load_config(args).cell
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
    angles = [
        (str(number), f"{q:.4f}", f"{math.degrees(q):.1f}", f"{low:g}", f"{high:g}")
        for number, (q, low, high) in enumerate(zip(state.q, joints.q_min, joints.q_max, strict=True), 1)
    ]
    table = filled(("joint", "rad", "degrees", "least", "largest"), angles, title=config.arm_unit())
    values = (
        ("finger centre (m)", "position"),
        ("its quaternion, w x y z", "quaternion"),
        ("end of a straight peg (m)", "tip"),
        ("force on the hand (N)", "force"),
    )
    rows = [(name, "  ".join(f"{value:.4f}" for value in data[key])) for name, key in values]
    return show(args, Group(table, filled(("tool", "base frame"), rows)), data)
