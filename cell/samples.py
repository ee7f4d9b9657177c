"""One run's samples as a stream on disk: a fixed row a scan, written once a second, readable when cut off."""

import csv
from pathlib import Path

import numpy as np
import pyarrow as pa
from pydantic import ValidationError

from drivers import frames
from drivers.errors import JournalError
from drivers.quantities import FINGERS, TAXELS, ImpedanceSetpoint, Pose, SwitchState, Vector
from drivers.scene_facts import SceneFacts, Sight
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
    "true_peg_x",
    "true_peg_y",
    "true_peg_z",
    "true_peg_qw",
    "true_peg_qx",
    "true_peg_qy",
    "true_peg_qz",
    "true_hole_x",
    "true_hole_y",
    "true_hole_z",
    "true_hole_qw",
    "true_hole_qx",
    "true_hole_qy",
    "true_hole_qz",
)
"""SI units, base frame; `switch` is 1 closed, 0 open, -1 unknown; `frame` is the taxel frame's sequence number.

What begins with `true_` no sensor tells: a simulated cell records it for pictures, a physical one leaves it NaN. The
peg's frame is in the peg's middle with z from its end upward, the hole's in the middle of its mouth with z outward.
"""
TAXEL_COLUMNS = tuple(f"taxel_{finger}_{taxel}" for finger in ("left", "right") for taxel in range(TAXELS))
"""The values of `taxels`, counts, one column each in CSV."""
BATCH = 100
"""Rows that are written at once: a second at the usual scan rate."""
_SWITCH = {SwitchState.CLOSED: 1.0, SwitchState.OPEN: 0.0, SwitchState.UNKNOWN: -1.0}
_SCHEMA = pa.schema(
    [
        *((name, pa.float64()) for name in COLUMNS),
        ("taxels", pa.list_(pa.float64(), FINGERS * TAXELS)),
        ("joints", pa.list_(pa.float64())),
    ]
)
_FACTS = b"scene"
"""Key of the scene's facts in the head of the file."""
_TRUTH = COLUMNS.index("true_peg_x")
_NO_SETPOINT, _NO_SIGHT = np.full(3, np.nan), np.full(14, np.nan)


class SampleStream:
    """Writes the samples of one run as an Arrow IPC stream."""

    def __init__(self, path: Path, facts: SceneFacts | None = None) -> None:
        """Start the stream at `path`, with what a picture of the run has to know in its head.

        Raises:
            JournalError: The file cannot be written.
        """
        self._path = path
        self._block = np.empty((len(COLUMNS), BATCH))
        self._taxels = np.empty((BATCH, FINGERS * TAXELS))
        self._joints: list[list[float]] = []
        self._used = 0
        schema = _SCHEMA if facts is None else _SCHEMA.with_metadata({_FACTS: facts.model_dump_json()})
        try:
            self._file = pa.OSFile(str(path), "wb")
            self._writer = pa.ipc.new_stream(self._file, schema, options=pa.ipc.IpcWriteOptions(compression="zstd"))
        except OSError as error:
            raise JournalError(f"{path}: cannot be written: {error}") from None

    def add(
        self, seen: Observation, setpoint: ImpedanceSetpoint | None, stage: int, sight: Sight | None = None
    ) -> None:
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
        row[_TRUTH : _TRUTH + 14] = _NO_SIGHT if sight is None else (*_seven(sight.peg), *_seven(sight.hole))
        self._taxels[self._used] = seen.frame.values.reshape(-1)
        self._joints.append(seen.arm.q.tolist())
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
        columns.append(pa.array(self._joints, type=_SCHEMA.field("joints").type))
        batch = pa.record_batch(columns, schema=_SCHEMA)
        self._used, self._joints = 0, []
        try:
            self._writer.write_batch(batch)
            self._file.flush()
        except OSError as error:
            raise JournalError(f"{self._path}: cannot be written: {error}") from None


def read_samples(path: Path) -> dict[str, Vector]:
    """Return the columns of a run, as far as they reached the disk.

    Beside `COLUMNS`, `taxels` has shape (n, 40), counts, and `joints` shape (n, joints), rad. A column that an earlier
    version did not record is NaN, and `joints` has no columns then.

    Raises:
        JournalError: There is no such file.
    """
    schema, batches = _read(path)
    table = pa.Table.from_batches(batches, schema=schema)
    missing = np.full(table.num_rows, np.nan)
    samples: dict[str, Vector] = {
        name: table.column(name).to_numpy() if name in schema.names else missing for name in COLUMNS
    }
    for name in ("taxels", "joints"):
        values = np.empty(0)
        if name in schema.names:
            values = table.column(name).combine_chunks().flatten().to_numpy(zero_copy_only=False)
        samples[name] = values.reshape(table.num_rows, values.size // max(table.num_rows, 1))
    return samples


def read_facts(path: Path) -> SceneFacts:
    """Return what the scene of a run was made of.

    Raises:
        JournalError: There is no such file, or it was recorded by a version that did not write the facts of the scene.
    """
    schema, _ = _read(path)
    text = (schema.metadata or {}).get(_FACTS)
    try:
        return SceneFacts.model_validate_json(text or b"")
    except ValidationError:
        raise JournalError(f"{path}: recorded by another version, without what a picture of the cell needs") from None


def _read(path: Path) -> tuple[pa.Schema, list[pa.RecordBatch]]:
    """Return the schema of a file of samples and what of it is whole."""
    schema, batches = _SCHEMA, []
    try:
        with pa.OSFile(str(path), "rb") as file:
            reader = pa.ipc.open_stream(file)
            schema = reader.schema
            while True:
                batches.append(reader.read_next_batch())
    except FileNotFoundError:
        raise JournalError(f"{path}: no samples on record") from None
    except (StopIteration, pa.ArrowInvalid, OSError):
        pass  # the end, or the place where a killed run was cut off
    return schema, batches


def _seven(pose: Pose) -> tuple[float, ...]:
    """Return position and quaternion, wxyz, of a pose."""
    return (*pose.position.tolist(), *frames.quaternion(pose.rotation))


def export_csv(samples: dict[str, Vector], path: Path) -> None:
    """Write samples as CSV, one row a scan."""
    joints = [f"joint_{number}" for number in range(1, samples["joints"].shape[1] + 1)]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*COLUMNS, *TAXEL_COLUMNS, *joints])
        scalars = zip(*(samples[name].tolist() for name in COLUMNS), strict=True)
        lists = zip(scalars, samples["taxels"].tolist(), samples["joints"].tolist(), strict=True)
        writer.writerows((*row, *taxels, *q) for row, taxels, q in lists)
