"""Export of runs and their samples to files for other tools: Parquet and MCAP."""

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cell.records.sample_blocks import COLUMNS, JOINT_COLUMNS
from cell.records.samples import columns_of
from cell.records.schema import RunRow, finite
from drivers.errors import ConfigError
from drivers.quantities import Vector
from skills.catalogue import CATALOGUE

FRAME = "base"
"""Frame of positions, axes and forces: the robot's base."""
_UNITS = {
    **dict.fromkeys(("stamp", "theta_stamp"), "s"),
    **dict.fromkeys(("true_peg_q", "true_hole_q"), ""),
    **dict.fromkeys(("true_", "tip_", "tcp_", "setpoint_", "width"), "m"),
    "joint_velocity_": "rad/s",
    "joint_torque_": "N·m",
    **dict.fromkeys(("joint_", "theta"), "rad"),
    "force_": "N",
    "taxel_": "counts",
}
"""Unit by prefix of a column's name; the first prefix that fits decides. Columns without a fitting prefix have no unit."""
_NOTES = {
    "stamp": "cell's clock",
    "stage": "number of the skill; the file's own metadata names them",
    "switch": "1 closed, 0 open, -1 unknown",
    "frame": "sequence number of the taxel frame",
    "theta": "in-hand angle of the peg about the closing axis",
    "theta_stamp": "cell's clock, when theta was measured",
    "width": "opening of the hand",
    "taxel": "signed, baseline removed, positive is pressure",
    "joint_torque": "as the law commanded it, without what the arm itself adds against gravity",
}


def unit_of(column: str) -> str:
    """Return the unit of a column of samples; empty for numbers without one."""
    return next((unit for beginning, unit in _UNITS.items() if column.startswith(beginning)), "")


def write_samples_parquet(row: RunRow, samples: dict[str, Vector], path: Path) -> None:
    """Write the samples of one run as Parquet; column metadata hold unit, frame and note, file metadata hold the run.

    Raises:
        ConfigError: The file cannot be written.
    """
    flat = columns_of(samples)
    schema = pa.schema([pa.field(name, pa.float64(), metadata=_metadata(name)) for name in flat])
    head = {"run": json.dumps(asdict(row)), "stages": json.dumps(CATALOGUE.stages), "frame": FRAME}
    with _told(path):
        pq.write_table(pa.table(list(flat.values()), schema.with_metadata(head)), path)


def write_runs_parquet(rows: Sequence[RunRow], path: Path) -> None:
    """Write runs as Parquet, one row per run, with starts and ends as times in UTC.

    Raises:
        ConfigError: The file cannot be written.
    """
    kinds: dict[Any, Any] = {int: pa.int64(), str: pa.string(), float | None: pa.float64(), int | None: pa.int64()}
    names = {field.name: kinds[field.type] for field in RunRow.__dataclass_fields__.values()}
    names |= {"started": pa.timestamp("ms", "UTC"), "ended": pa.timestamp("ms", "UTC")}
    table = {name: [getattr(row, name) for row in rows] for name in names}
    for name in ("started", "ended"):
        table[name] = [datetime.fromisoformat(text) if text else None for text in table[name]]
    with _told(path):
        pq.write_table(pa.table(table, pa.schema(list(names.items()))), path)


def write_mcap(row: RunRow, samples: dict[str, Vector], path: Path) -> None:
    """Write the samples of one run as MCAP with JSON schemas: poses in Foxglove's schema, the rest as plain numbers.

    Raises:
        ConfigError: The package mcap is missing, or the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise ConfigError("--export mcap: needs the package mcap; pip install 'tactile-insertion-cell[mcap]'") from None

    with _told(path), path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="tactile-insertion-cell")
        channels = {}
        for topic, (name, schema) in _TOPICS.items():
            number = writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            channels[topic] = writer.register_channel(topic, "json", number)
        writer.add_metadata("run", {name: str(value) for name, value in asdict(row).items()})
        for place, (time, topic, message) in enumerate(_messages(row, samples)):
            writer.add_message(channels[topic], time, json.dumps(message).encode(), time, place)
        writer.finish()  # type: ignore[no-untyped-call]


def _metadata(column: str) -> dict[str, str]:
    told = {"unit": unit_of(column)}
    if unit_of(column) in ("m", "N") and column != "width":
        told["frame"] = FRAME
    note = _NOTES.get(column) or next((text for name, text in _NOTES.items() if column.startswith(f"{name}_")), "")
    return told | ({"note": note} if note else {})


_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_VECTOR = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_TURN = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyzw"}}
_POSE = {"type": "object", "properties": {"position": _VECTOR, "orientation": _TURN}}


def _schema(title: str, **properties: object) -> tuple[str, dict[str, object]]:
    return title, {"title": title, "type": "object", "properties": {"timestamp": _TIME, **properties}}


_NUMBERS = {"type": "array", "items": {"type": "number"}}
_TOPICS: dict[str, tuple[str, dict[str, object]]] = {
    "/tip": _schema("foxglove.PoseInFrame", frame_id={"type": "string"}, pose=_POSE),
    "/force": _schema("cell.Force", frame_id={"type": "string"}, force=_VECTOR, magnitude={"type": "number"}),
    "/peg": _schema("cell.Peg", theta={"type": "number"}, age={"type": "number"}),
    "/touch": _schema("cell.Touch", left=_NUMBERS, right=_NUMBERS),
    "/joints": _schema("cell.Joints", position=_NUMBERS, velocity=_NUMBERS, effort=_NUMBERS),
    "/cell": _schema("cell.State", stage={"type": "string"}, width={"type": "number"}, switch={"type": "number"}),
}
"""Content of each topic: SI units, radians, counts; pose and time are in Foxglove's schema."""


def _messages(row: RunRow, samples: dict[str, Vector]) -> Iterator[tuple[int, str, dict[str, object]]]:
    """Yield time, ns since 1970, topic and message of each scan."""
    start = int(datetime.fromisoformat(row.started).timestamp() * 1e9)
    stamps = samples["stamp"]
    for scan in range(stamps.size):
        time = start + round(float(stamps[scan] - stamps[0]) * 1e9)
        at = {name: finite(samples[name][scan]) for name in COLUMNS}
        stamp = {"timestamp": {"sec": time // 10**9, "nsec": time % 10**9}}
        force = {axis: at[f"force_{axis}"] for axis in "xyz"}
        axis = np.array([samples[f"axis_{part}"][scan] for part in "xyz"])
        left, right = np.split(samples["taxels"][scan], 2)
        pose = {"position": {part: at[f"tip_{part}"] for part in "xyz"}, "orientation": _turn(axis)}
        age = float(stamps[scan] - samples["theta_stamp"][scan])
        yield time, "/tip", {**stamp, "frame_id": FRAME, "pose": pose}
        size = math.sqrt(sum(float(samples[f"force_{part}"][scan]) ** 2 for part in "xyz"))
        yield time, "/force", {**stamp, "frame_id": FRAME, "force": force, "magnitude": finite(size)}
        yield time, "/peg", {**stamp, "theta": at["theta"], "age": finite(age)}
        yield time, "/touch", {**stamp, "left": left.tolist(), "right": right.tolist()}
        joints = ([finite(each) for each in samples[name][scan].tolist()] for name in JOINT_COLUMNS)
        yield time, "/joints", {**stamp, **dict(zip(("position", "velocity", "effort"), joints, strict=True))}
        stage = CATALOGUE.stages.get(int(samples["stage"][scan]), "")
        yield time, "/cell", {**stamp, "stage": stage, "width": at["width"], "switch": at["switch"]}


def _turn(axis: Vector) -> dict[str, float]:
    """Return the shortest rotation from z to a unit axis, as a quaternion; half a turn about x for -z and for NaN."""
    x, y, z = axis.tolist()
    if not math.isfinite(x + y + z) or z < -1.0 + 1e-9:
        return {"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}
    w = math.sqrt((1.0 + z) / 2.0)
    return {"x": -y / (2.0 * w), "y": x / (2.0 * w), "z": 0.0, "w": w}


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error}") from None
