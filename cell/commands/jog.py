"""`cell jog`: move the tool by keys."""

import argparse

from cell.calibrate.hand_motion import DEAD_MAN, JOG_SPEED, moved_by_keys
from cell.calibrate.keys import keys
from cell.commands.arguments import add_config, load_config
from cell.commands.terminal import GOOD, complain, say
from cell.devices.assembly import assemble, opened
from drivers.quantities import ArmState

KEYS = "x y z move forth, X Y Z back; g closes the fingers, o opens them; q ends"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --config and --set."""
    add_config(parser)
    parser.epilog = KEYS


def run(args: argparse.Namespace) -> int:
    """Move the tool while a key is held down; 0.2 s after the last key the arm stops."""
    tell = complain if args.json else say

    def act(key: str, state: ArmState) -> bool:
        tell(f"{key}: no such key; x y z X Y Z g o and q allowed")
        return True

    config = load_config(args).cell
    with opened(assemble(config), "arm", "gripper") as cell, keys() as pressed:
        motion = f"{JOG_SPEED * 1e3:g} mm/s while a key is held, still {DEAD_MAN:g} s after it"
        tell(f"{KEYS}; {motion}. Keep a hand on the stop.")
        moved_by_keys(cell, pressed, act, is_guided=False)
        x, y, z = cell.arm.read().tcp.position
        tell(f"finger centre at {x:.4f}, {y:.4f}, {z:.4f} m")
    return GOOD
