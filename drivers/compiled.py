"""Where compiled functions are kept: numba's `njit` and `cfunc` with a cache that cannot be stale.

Numba stores a compiled function beside its source and looks at that one file's age. A function that calls
into another file is then not compiled anew when the other file changes, and silently runs the old law. Here the
folder of the cache carries a digest of every source that is compiled, and of the compiler's version.
"""

import hashlib
import os
import tempfile
from pathlib import Path

import numba
from numba import cfunc as cfunc
from numba import njit as njit


def _digest() -> str:
    """Return a digest of all that compiled functions are made of."""
    here = Path(__file__).parent
    parts = [numba.__version__.encode()]
    folders = (here, here.parent / "sim", here.parent / "skills" / "tactile")
    parts += [path.read_bytes() for folder in folders for path in sorted(folder.glob("*.py"))]
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16]


def _folder() -> Path:
    """Return a folder of the user's own cache that can be written, or one in the system's temporary folder."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for root in (home, Path(tempfile.gettempdir())):
        folder = root / "tactile-cell" / _digest()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    raise OSError(f"no folder for compiled functions: neither {home} nor {tempfile.gettempdir()} can be written")


numba.config.CACHE_DIR = str(_folder())
