"""A text recording of a CySkin patch, [cyskin], played as a Skin: four of its modules represent the two fingers."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigError, DeviceNotOpenedError, SkinSilentError
from drivers.protocols import Clock
from drivers.quantities import FINGERS, TaxelFrame, Vector
from drivers.skin.board_config import BOARD_MODULES, MODULE_CHANNELS
from drivers.skin.health import ERROR_COUNT, Counts
from drivers.skin.layout import MODULE_TAXELS


class Recording:
    """Content of a recording of [cyskin].

    The file's first line names the channels, uid = sui << 4 | name, where name 0 is a temperature. Every other line has
    a frame index, a time, s, and one unsigned reading for each channel, with the baseline already removed.

    Raises:
        ConfigError: The file is missing, or has another form.
    """

    def __init__(self, path: Path) -> None:
        try:
            lines = [line.split() for line in path.read_text(encoding="ascii").splitlines() if line.strip()]
            uid = np.array(lines[0], dtype=np.int64)
            table = np.array(lines[1:], dtype=float)
            if table.shape != (len(lines) - 1, len(uid) + 2) or len(table) == 0:
                raise ValueError("rows of different length")
        except OSError as error:
            raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, IndexError, OverflowError):
            raise ConfigError(
                f"{path}: no recording: a line of channel ids, then lines of index, time, readings"
            ) from None
        self.times: Vector = table[:, 1] - table[0, 1]
        """Time of each frame since the first one, s."""
        is_taxel = uid & 15 > 0
        self.uid: NDArray[np.int64] = uid[is_taxel]
        """Number (uid) of each taxel's channel."""
        self.module = self.uid >> 4
        """Own number (sui) of each taxel's module."""
        self.counts: Counts = np.clip(table[:, 2:][:, is_taxel], 0, 0xFFFF).astype(np.uint16)
        """Readings, counts, one row for each frame."""

    def most_touched(self) -> list[int]:
        """Return the own numbers of the four most touched modules among those with enough taxels."""
        uids = set(self.uid.tolist())
        whole = [
            n for n in np.unique(self.module).tolist() if uids.issuperset(n << 4 | name for name in MODULE_CHANNELS)
        ]
        touch = np.where(self.counts < ERROR_COUNT, self.counts, 0).max(axis=0)
        return sorted(whole, key=lambda n: int(touch[self.module == n].max()))[-BOARD_MODULES:]


class RecordedSkin:
    """Plays a recording once at the speed of the cell's clock, from the time of its opening."""

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path, self._clock = path, clock
        self._recording: Recording | None = None

    def open(self) -> None:
        """Read the file.

        Raises:
            ConfigError: The file is missing, has another form, or has too few whole modules.
        """
        recording = Recording(self._path)
        chosen = recording.most_touched()
        at = {uid: place for place, uid in enumerate(recording.uid.tolist())}
        if len(chosen) != BOARD_MODULES:
            raise ConfigError(f"{self._path}: {BOARD_MODULES} modules with {MODULE_TAXELS} taxels needed, not {chosen}")
        places = [at[sui << 4 | name] for sui in chosen for name in MODULE_CHANNELS]
        self._taxels = np.array(places).reshape(FINGERS, -1)
        self._is_alive = recording.counts[:, self._taxels].any(axis=0)
        self._recording, self._start = recording, self._clock.now()

    def close(self) -> None:
        """Release the file's content."""
        self._recording = None

    def read(self) -> TaxelFrame:
        """Return the newest frame; see `drivers.protocols.Skin`."""
        if self._recording is None:
            raise DeviceNotOpenedError("skin: read before it was opened")
        elapsed = self._clock.now() - self._start
        number = int(np.searchsorted(self._recording.times, elapsed + 1e-9, side="right")) - 1
        age = elapsed - self._recording.times[number]
        limit = 0.35  # Time without a frame after which the skin is silent, s.
        if age > limit:
            raise SkinSilentError(f"skin: no frame for {age:.3f} s > {limit:.3f} s limit: {self._path} has ended")
        counts = self._recording.counts[number][self._taxels]
        trusted = self._is_alive & (counts < ERROR_COUNT)
        stamp = self._start + float(self._recording.times[number])
        return TaxelFrame(np.where(trusted, counts.astype(float), 0.0), trusted, stamp, number)
