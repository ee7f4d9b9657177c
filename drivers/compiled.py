"""Numba's `njit` and `cfunc` with a private cache on disk that is never stale.

Numba keys a compiled function by the content of its own source file. If a function calls into another file and that file
changes, numba would run the old code. Each function is therefore stored in a folder with a digest in its name. The digest
covers the function's file, every file of this project that this file imports, directly or not, and numba's version.
Compiled code runs unchecked, so it is read only from a folder that no other user can write.

No function is compiled with `fastmath`. With it, the order of sums depends on what the process compiled before. The same
source and seed then gave rows that differed in the last bits (1 trial in 20, by 1e-12).
"""

import atexit
import hashlib
import logging
import os
import re
import shutil
import tempfile
from functools import cache, partial
from pathlib import Path
from types import FunctionType

import numba

logger = logging.getLogger(__name__)

njit = partial(numba.njit, error_model="numpy")
"""Compiles a function; a division by zero gives infinity or NaN, as in IEEE 754, without a branch to an exception."""
cfunc = partial(numba.cfunc, error_model="numpy")
"""Compiles a function that C calls."""

PROJECT = Path(__file__).parent.parent
PACKAGES = "drivers", "sim", "skills"
"""Packages of this project with compiled functions or their sources."""
_IMPORT = re.compile(
    rf"^\s*from\s+((?:{'|'.join(PACKAGES)})[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)"
    rf"|^\s*import\s+((?:{'|'.join(PACKAGES)})[\w.]*)",
    re.MULTILINE,
)


@cache
def sources(path: Path) -> frozenset[Path]:
    """Return a file of this project and every file that it imports, directly or not."""
    found, waiting = {path}, [path]
    while waiting:
        for named in _imported(waiting.pop().read_text(encoding="utf-8")):
            if named not in found and named.is_file():
                found.add(named)
                waiting.append(named)
    return frozenset(found)


def _imported(text: str) -> list[Path]:
    """Return the names of the modules that a source may import; `from a import b` may mean the modules a and a.b."""
    places = []
    for package, names, module in _IMPORT.findall(text):
        at = PROJECT.joinpath(*(package or module).split("."))
        places += [at.with_suffix(".py"), at / "__init__.py"]
        places += [at / f"{name}.py" for name in re.findall(r"\w+", names)]
    return places


@cache
def digest(path: Path) -> str:
    """Return a digest of all sources of a file's compiled functions."""
    parts = [numba.__version__.encode()]
    for source in sorted(sources(path)):
        parts += [source.relative_to(PROJECT).as_posix().encode(), source.read_bytes()]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:16]


@cache
def folder() -> Path:
    """Return the folder of all compiled functions: the user's own cache, or a new folder if this cache is not safe.

    The cache is not used if another user owns it or can write to it: its content would run as part of this program.
    A new folder costs a compilation at each start, and a warning in the log.
    """
    kept = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tactile-cell" / "compiled"
    try:
        for made in (kept.parent, kept):
            made.mkdir(mode=0o700, parents=True, exist_ok=True)
            found = made.stat()
            if found.st_uid != os.geteuid() or found.st_mode & 0o022:
                raise PermissionError(
                    f"{made}: owner {found.st_uid}, mode {found.st_mode & 0o777:o}; own and 700 needed"
                )
        with tempfile.TemporaryFile(dir=kept):
            return kept
    except OSError as error:
        logger.warning("functions are compiled anew at each start: %s", error)
    fresh = Path(tempfile.mkdtemp(prefix="tactile-cell-"))
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    return fresh


def is_kept(name: str) -> bool:
    """Return True if the cache holds functions of the file `name`, a path from the project's root, for its present sources."""
    path = PROJECT / name
    return any((folder() / f"{path.stem}-{digest(path)}").glob("*.nbi"))


def is_noted(what: str) -> bool:
    """Return True if `note` has recorded, for the present sources, that the cache holds all functions that `what` compiles."""
    return _note_of(what).is_file()


def note(what: str) -> None:
    """Record that the cache holds all functions that `what` compiles."""
    _note_of(what).touch(mode=0o600)


def _note_of(what: str) -> Path:
    return folder() / f"noted-{hashlib.sha256(f'{_digest_of_all()}{what}'.encode()).hexdigest()[:16]}"


@cache
def _digest_of_all() -> str:
    """Return a digest of every file of this project that may hold compiled functions."""
    files = sorted(file for package in PACKAGES for file in (PROJECT / package).rglob("*.py"))
    return hashlib.sha256(b"\0".join([numba.__version__.encode(), *(file.read_bytes() for file in files)])).hexdigest()


class SourceLocator:
    """Locates the cache of a function of this project, with the interface of a locator of `numba.core.caching`."""

    def __init__(self, function: FunctionType, path: Path) -> None:
        self._py_file = str(path)  # numba names this file if it cannot cache a function
        self._line, self._digest = function.__code__.co_firstlineno, digest(path)
        self._folder = folder() / f"{path.stem}-{self._digest}"

    @classmethod
    def from_function(cls, function: FunctionType, file: str) -> "SourceLocator | None":
        """Return the locator of a function of this project, None for any other."""
        path = Path(file)
        return cls(function, path) if path.is_relative_to(PROJECT) and path.is_file() else None

    def ensure_cache_path(self) -> None:
        """Create the folder of the cache."""
        self._folder.mkdir(mode=0o700, exist_ok=True)

    def get_cache_path(self) -> str:
        """Return the folder of the cache."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return the digest of the stored function's sources."""
        return self._digest

    def get_disambiguator(self) -> str:
        """Return the line number, which distinguishes functions of the same name in a file."""
        return str(self._line)


numba.config.CACHE_LOCATOR_CLASSES = f"{__name__}.{SourceLocator.__name__},UserWideCacheLocator"
