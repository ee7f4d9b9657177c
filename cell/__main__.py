"""Entry point of `python -m cell` and of the command `cell`.

Worker processes import this module again, so that it imports what a command needs only when that command is run.
"""

import gc
import signal
import sys
from importlib.util import find_spec
from pathlib import Path


def main() -> int:
    """Run one command and return its exit status."""
    try:
        if foreign := _foreign_packages():
            sys.stderr.write(f"{foreign}\n")
            return 2
        from drivers.errors import CellError

        try:
            from cell.cli import main as run
        except CellError as error:
            # Faults of a catalogue show when it is read.
            sys.stderr.write(f"{error}\n")
            return 2
        return run()
    except (
        KeyboardInterrupt
    ):  # before the command line listens, or a second time while what was interrupted is put in order
        sys.stderr.write("cell: stopped\n")
        return 1
    finally:
        # Whatever the interpreter still has to put in order, another Ctrl-C ends it at once.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        gc.freeze()  # what is left goes with the process; looking for cycles in it would take half a second


def _foreign_packages() -> str:
    """Return one line if another distribution's package hides one of this program's, or an empty text."""
    home = Path(__file__).parent.parent
    for name in ("drivers", "plc_bridge", "sim", "skills"):
        found = find_spec(name)
        places = [Path(place) for place in (found.submodule_search_locations or ())] if found else []
        if found and home / name not in places and (home / name).is_dir():
            return f"cell: package {name}: found in {places[0] if places else found.origin}, which is not this program's; {home / name} needed: install it in an environment of its own (pipx or uv tool install)"
    return ""


if __name__ == "__main__":
    sys.exit(main())
