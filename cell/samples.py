"""One run's samples as a stream on disk: a fixed row a scan, written once a second, readable when cut off."""

import csv
from pathlib import Path

import numpy as np
import pyarrow as pa

from drivers.errors import JournalError
from drivers.quantities import FINGERS, TAXELS, ImpedanceSetpoint, SwitchState, Vector
from skills.contract import Observation

COLUMNS: tuple[str, ...] = (
    "stamp",
    "stage",
    "tip_x",
    "tip_y",
    "tip_z",
    "axis_x",
    "axis_y",
    "axis_z",
    "theta",
    "theta_stamp",
    "tcp_x",
    "tcp_y",
    "tcp_z",
    "force_x",
    "force_y",
    "force_z",
    "setpoint_x",
    "setpoint_y",
    "setpoint_z",
    "width",
    "switch",
    "frame",
)
"""SI units, base frame; `switch` is 1 closed, 0 open, -1 unknown; `frame` is the taxel frame's sequence number."""
TAXEL_COLUMNS = tuple(f"taxel_{finger}_{taxel}" for finger in ("left", "right") for taxel in range(TAXELS))
"""The values of `taxels`, counts, one column each in CSV."""
BATCH = 100
"""Rows that are written at once: a second at the usual scan rate."""
_SWITCH = {SwitchState.CLOSED: 1.0, SwitchState.OPEN: 0.0, SwitchState.UNKNOWN: -1.0}
_SCHEMA = pa.schema([*((name, pa.float64()) for name in COLUMNS), ("taxels", pa.list_(pa.float64(), FINGERS * TAXELS))])
_NO_SETPOINT = np.full(3, np.nan)


class SampleStream:
    """Writes the samples of one run as an Arrow IPC stream."""

    def __init__(self, path: Path) -> None:
        """Start the stream at `path`.

        Raises:
            JournalError: The file cannot be written.
        """
        self._path = path
        self._block = np.empty((len(COLUMNS), BATCH))
        self._taxels = np.empty((BATCH, FINGERS * TAXELS))
        self._used = 0
        try:
            self._file = pa.OSFile(str(path), "wb")
            self._writer = pa.ipc.new_stream(self._file, _SCHEMA, options=pa.ipc.IpcWriteOptions(compression="zstd"))
        except OSError as error:
            raise JournalError(f"{path}: cannot be written: {error}") from None

    def add(self, seen: Observation, setpoint: ImpedanceSetpoint | None, stage: int) -> None:
        """Add one scan; every full block goes to the disk.

        Raises:
            JournalError: The file cannot be written.
        """
        row = self._block[:, self._used]
        row[0], row[1] = seen.stamp, stage
        row[2:5], row[5:8] = seen.tip, seen.axis
        row[8], row[9] = seen.peg.theta, seen.peg.stamp
        row[10:13], row[13:16] = seen.arm.tcp.position, seen.arm.wrench.force
        row[16:19] = _NO_SETPOINT if setpoint is None else setpoint.tip
        row[19], row[20], row[21] = seen.gripper.width, _SWITCH[seen.switch], seen.frame.sequence
        self._taxels[self._used] = seen.frame.values.reshape(-1)
        self._used += 1
        if self._used == BATCH:
            self._write()

    def close(self) -> None:
        """Write what is left and end the stream.

        Raises:
            JournalError: The file cannot be written.
        """
        self._write()
        try:
            self._writer.close()
            self._file.close()
        except OSError as error:
            raise JournalError(f"{self._path}: cannot be written: {error}") from None

    def _write(self) -> None:
        if self._used == 0:
            return
        taxels = pa.array(self._taxels[: self._used].reshape(-1))
        columns = [pa.array(column[: self._used]) for column in self._block]
        columns.append(pa.FixedSizeListArray.from_arrays(taxels, FINGERS * TAXELS))
        batch = pa.record_batch(columns, schema=_SCHEMA)
        self._used = 0
        try:
            self._writer.write_batch(batch)
            self._file.flush()
        except OSError as error:
            raise JournalError(f"{self._path}: cannot be written: {error}") from None


def read_samples(path: Path) -> dict[str, Vector]:
    """Return the columns of a run, as far as they reached the disk, and `taxels`, shape (n, 40), counts.

    Raises:
        JournalError: There is no such file.
    """
    batches = []
    try:
        with pa.OSFile(str(path), "rb") as file:
            reader = pa.ipc.open_stream(file)
            while True:
                batches.append(reader.read_next_batch())
    except FileNotFoundError:
        raise JournalError(f"{path}: no samples on record") from None
    except (StopIteration, pa.ArrowInvalid, OSError):
        pass  # the end, or the place where a killed run was cut off
    table = pa.Table.from_batches(batches, schema=_SCHEMA)
    samples: dict[str, Vector] = {name: table.column(name).to_numpy() for name in COLUMNS}
    taxels = table.column("taxels").combine_chunks()
    samples["taxels"] = taxels.flatten().to_numpy(zero_copy_only=False).reshape(-1, FINGERS * TAXELS)
    return samples


def export_csv(samples: dict[str, Vector], path: Path) -> None:
    """Write samples as CSV, one row a scan."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS + TAXEL_COLUMNS)
        scalars = zip(*(samples[name].tolist() for name in COLUMNS), strict=True)
        writer.writerows((*row, *taxels) for row, taxels in zip(scalars, samples["taxels"].tolist(), strict=True))
