"""One run's samples as a stream on disk: one row per scan, written once a second, readable even if truncated."""

import csv
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pydantic import ValidationError

from cell.records.sample_blocks import COLUMNS, JOINT_COLUMNS, SampleBlock, taxel_columns
from drivers.errors import JournalError
from drivers.quantities import Vector
from drivers.scene_facts import SceneFacts

_SCHEMA = pa.schema(
    [
        *((name, pa.float64()) for name in COLUMNS),
        ("taxels", pa.list_(pa.float64())),
        *((name, pa.list_(pa.float64())) for name in JOINT_COLUMNS),
    ]
)
_FACTS = b"scene"
"""Key of the scene's facts in the head of the file."""
_RUN, _ENDING = b"run", b"ending"
"""Keys of the run's row: in the head of the file, and together with the run's stages in the last block."""


class SampleFile:
    """The file of one run's samples; a file with content is never overwritten."""

    def __init__(self, path: Path, facts: SceneFacts | None = None, row: str = "") -> None:
        """Start the file at `path`.

        Args:
            path: A new file, or an empty one.
            facts: Facts of the scene for pictures of the run.
            row: The run's row at its start, JSON; a lost index is rebuilt from it.

        Raises:
            JournalError: The file cannot be written, or is not empty.
        """
        self.path = path
        head = {} if facts is None else {_FACTS: facts.model_dump_json().encode()}
        if row:
            head[_RUN] = row.encode()
        with self._told():
            _require_empty(path)
            self._file = pa.OSFile(str(path), "wb")
            options = pa.ipc.IpcWriteOptions(compression="zstd")
            self._writer = pa.ipc.new_stream(self._file, _SCHEMA.with_metadata(head), options=options)
            self._file.flush()

    def write(self, block: SampleBlock, ending: str = "") -> None:
        """Write the rows of a block; `ending` is the run's row and its stages as JSON, for the last block.

        Raises:
            JournalError: The file cannot be written.
        """
        columns = [_numbers(column[: block.used]) for column in block.values]
        columns += [_lists(block.taxels), *(_lists(block.joints[name]) for name in JOINT_COLUMNS)]
        batch = pa.record_batch(columns, schema=_SCHEMA)
        with self._told():
            if ending:
                self._writer.write_batch(batch, custom_metadata={_ENDING: ending.encode()})
            else:
                self._writer.write_batch(batch)
            self._file.flush()

    def close(self) -> None:
        """End the stream and close the file.

        Raises:
            JournalError: The file cannot be written.
        """
        with self._told():
            self._writer.close()
            self._file.close()

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise JournalError(f"{self.path}: cannot be written: {error}") from None


def _require_empty(path: Path) -> None:
    """Create a file for its owner only, if it is missing.

    Raises:
        OSError: The file cannot be created, or is not empty.
    """
    number = os.open(path, os.O_CREAT | os.O_RDWR, 0o600)
    try:
        if os.fstat(number).st_size:
            raise FileExistsError("holds samples already")
    finally:
        os.close(number)


def _numbers(values: Vector) -> pa.Array:
    """Return values as a column that shares their memory; `pa.array` would import pandas if installed, which is slow."""
    return pa.Array.from_buffers(pa.float64(), values.size, [None, pa.py_buffer(values)])


def _lists(rows: Sequence[Vector | Sequence[float]]) -> pa.ListArray:
    """Return rows of equal length as a column of lists."""
    values = np.array(rows, dtype=float).reshape(len(rows), -1) if rows else np.empty((0, 0))
    ends = np.arange(len(rows) + 1, dtype=np.int32) * values.shape[1]
    offsets = pa.Array.from_buffers(pa.int32(), ends.size, [None, pa.py_buffer(ends)])
    return pa.ListArray.from_arrays(offsets, _numbers(values.reshape(-1)))


def read_samples(path: Path) -> dict[str, Vector]:
    """Return the columns of a run, as far as they reached the disk.

    In addition to `COLUMNS`, `taxels` has shape (n, taxels of both fingers), counts, and each of `JOINT_COLUMNS` shape (n, joints). If an
    earlier version did not record a column, it is NaN; a list of joints then has no columns.

    Raises:
        JournalError: The file is missing, or its columns are damaged.
    """
    schema, batches, _ = _read(path)
    try:
        return _columns(pa.Table.from_batches(batches, schema=schema))
    except (pa.ArrowException, KeyError, TypeError, ValueError) as error:
        raise JournalError(f"{path}: damaged: {error}") from None


def _columns(table: pa.Table) -> dict[str, Vector]:
    missing = np.full(table.num_rows, np.nan)
    samples: dict[str, Vector] = {
        name: _values(table.column(name).combine_chunks()) if name in table.column_names else missing
        for name in COLUMNS
    }
    for name in ("taxels", *JOINT_COLUMNS):
        values = np.empty(0)
        if name in table.column_names:
            values = _values(table.column(name).combine_chunks().flatten())
        samples[name] = values.reshape(table.num_rows, values.size // max(table.num_rows, 1))
    return samples


def _values(column: pa.Array) -> Vector:
    """Return the values of a column; `to_numpy` would import pandas if installed, which is slow."""
    return np.from_dlpack(column).astype(float)


def read_facts(path: Path) -> SceneFacts:
    """Return the facts of a run's scene.

    Raises:
        JournalError: The file is missing, its head is damaged, or its version did not record the facts of the scene.
    """
    schema, _, _ = _read(path, is_whole=False)
    if schema is _SCHEMA:
        raise JournalError(f"{path}: torn: not even its head can be read")
    text = (schema.metadata or {}).get(_FACTS)
    try:
        return SceneFacts.model_validate_json(text or b"")
    except ValidationError:
        raise JournalError(f"{path}: recorded by another version, without what a picture of the cell needs") from None


def read_rows(path: Path) -> tuple[bytes, bytes]:
    """Return the run's row at its start, and its row with its stages at its end, both JSON; empty if not on record.

    Raises:
        JournalError: The file is missing.
    """
    schema, _, ending = _read(path)
    return (schema.metadata or {}).get(_RUN, b""), ending


def _read(path: Path, is_whole: bool = True) -> tuple[pa.Schema, list[pa.RecordBatch], bytes]:
    """Return the schema of a file of samples, its undamaged blocks, and the run's end from the last block; only the schema if not `is_whole`."""
    schema, batches, ending = _SCHEMA, [], b""
    try:
        with pa.OSFile(str(path), "rb") as file:
            reader = pa.ipc.open_stream(file)
            schema = reader.schema
            while is_whole:
                batch, told = reader.read_next_batch_with_custom_metadata()
                batch.validate(full=True)  # without this check, readers would follow wrong lengths and offsets
                batches.append(batch)
                ending = ending if told is None else told.get(_ENDING, b"")
    except FileNotFoundError:
        raise JournalError(f"{path}: no samples on record") from None
    except (StopIteration, pa.ArrowException, OSError, UnicodeError):
        pass  # the end of the file, the truncation by a killed run, or damage
    return schema, batches, ending


def columns_of(samples: dict[str, Vector]) -> dict[str, Vector]:
    """Return samples with one flat column for each taxel and each joint."""
    flat = {name: samples[name] for name in COLUMNS}
    taxels = samples["taxels"]
    flat |= {name: taxels[:, place] for place, name in enumerate(taxel_columns(taxels.shape[1]))}
    for name, beginning in JOINT_COLUMNS.items():
        flat |= {f"{beginning}_{place + 1}": samples[name][:, place] for place in range(samples[name].shape[1])}
    return flat


def export_csv(samples: dict[str, Vector], path: Path) -> None:
    """Write samples as CSV, one row per scan."""
    flat = columns_of(samples)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(flat)
        writer.writerows(zip(*(column.tolist() for column in flat.values()), strict=True))


def torn(path: Path, found: Mapping[str, Any], recorded: int) -> str:
    """Return one line about unreadable samples of a run; empty if all recorded samples can be read."""
    read = len(found["stamp"])
    return f"{path}: torn: {read} of {recorded} samples can be read" if read < recorded else ""
