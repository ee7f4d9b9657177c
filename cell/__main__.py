"""Entry point of `python -m cell` and of the command `cell`.

Worker processes import this module again, so a command's dependencies are imported only when it runs.
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
            from cell.commands.cli import main as run
        except CellError as error:
            # Faults of a catalogue are raised at its import.
            sys.stderr.write(f"{error}\n")
            return 2
        return run()
    except KeyboardInterrupt:  # before the command line handles signals, or a second time during cleanup
        sys.stderr.write("cell: stopped\n")
        return 1
    finally:
        # During the interpreter's own cleanup, another Ctrl-C ends the process at once.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        gc.freeze()  # the process frees its memory at exit; a search for cycles would take half a second


def _foreign_packages() -> str:
    """Return one line if another distribution's package hides one of this program's; else empty."""
    home = Path(__file__).parent.parent
    for name in ("drivers", "plc_bridge", "sim", "skills"):
        found = find_spec(name)
        places = [Path(place) for place in (found.submodule_search_locations or ())] if found else []
        if found and home / name not in places and (home / name).is_dir():
            return f"cell: package {name}: found in {places[0] if places else found.origin}, which is not this program's; {home / name} needed: install it in an environment of its own (pipx or uv tool install)"
    return ""


if __name__ == "__main__":
    sys.exit(main())
