"""A file that a thread writes has the newest text, and its users never wait."""

import os
import threading
from pathlib import Path

import pytest

from cell.records.kept_file import KeptFile
from tests.trouble import full_disk, until


def test_a_slow_disk_delays_nobody_and_the_newest_text_is_kept(tmp_path, monkeypatch):
    goes_on, begun = threading.Event(), threading.Event()

    def fsync(number):
        begun.set()
        assert goes_on.wait(10.0)

    monkeypatch.setattr(os, "fsync", fsync)
    file = KeptFile(tmp_path / "part.json", "a thing")
    file.put("first")
    assert begun.wait(10.0)
    file.put("second")
    file.put("third")
    assert not file.flush(0.0)
    goes_on.set()
    assert file.flush(10.0)
    assert file.path.read_text() == "third"


def test_text_and_name_are_on_the_disk_once_flushed(tmp_path, monkeypatch):
    file, synced = KeptFile(tmp_path / "part.json", "a thing"), []
    opened = Path("/proc/self/fd")
    monkeypatch.setattr(
        os, "fsync", lambda number: synced.append(((opened / f"{number}").is_dir(), file.path.exists()))
    )
    file.put("first")
    assert file.flush(10.0)
    assert synced == [(False, False), (True, True)]


@pytest.mark.parametrize("is_void", [True, False])
def test_a_text_that_cannot_be_written_is_retried(tmp_path, caplog, is_void):
    file = KeptFile(tmp_path / "part.json", "a thing", is_void_if_late=is_void)
    file.put("first")
    assert file.flush(10.0)
    with full_disk():
        file.put("second")
        until(lambda: caplog.text)
        file.put("third")
        assert not file.flush(1.1)
        assert file.path.read_text() == ("" if is_void else "first")
    assert file.flush(10.0)
    assert file.path.read_text() == "third"
    assert caplog.text.count("cannot be kept") == 1
