"""A slow or closed reader of the log delays no thread."""

import io
import logging
import os
from types import SimpleNamespace

import pytest

from cell.records.patient_log import MOST, PatientHandler, SparseFilter


@pytest.fixture
def log():
    """Return a logger of its own."""
    logger = logging.Logger("patient")
    yield logger
    for handler in logger.handlers:
        handler.close()


def test_lines_are_written_in_order(log):
    handler = PatientHandler(stream := io.StringIO())
    log.addHandler(handler)
    for number in range(3):
        log.error("line %d", number)
    handler.flush()
    assert stream.getvalue() == "line 0\nline 1\nline 2\n"


def test_a_slow_reader_delays_nobody_and_gets_the_number_dropped(log):
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as stream, os.fdopen(reading, encoding="utf-8") as reader:
        handler = PatientHandler(stream)
        log.addHandler(handler)
        for _ in range(2 * MOST):
            log.error("x" * 100)
        assert handler.dropped > 0
        lines = [reader.readline() for _ in range(2 * MOST - handler.dropped)]
        log.error("read on")
        while not lines[-1].startswith("read on"):
            lines.append(reader.readline())
    assert f"{handler.dropped} lines of the log were dropped: their reader was too slow\n" in lines


def test_a_closed_stream_stops_nobody(log):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as stream:
        handler = PatientHandler(stream)
        log.addHandler(handler)
        for _ in range(2):
            log.error("anybody?")
            handler.flush()
    assert handler.dropped == 0


def test_repeated_lines_are_written_once_in_ten_seconds(monkeypatch, caplog):
    now = [100.0]
    monkeypatch.setattr("cell.records.patient_log.time", SimpleNamespace(monotonic=lambda: now[0]))
    log = logging.getLogger("tests.sparse")
    log.addFilter(SparseFilter())
    for now[0] in (100.0, 100.1, 105.0, 110.0):
        log.warning("%s knocks", now[0])
        log.warning("another")
    knocks = [text for text in caplog.messages if "knocks" in text]
    assert knocks == ["100.0 knocks", "110.0 knocks (2 more like this before)"]
