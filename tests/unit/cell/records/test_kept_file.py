"""A file that a thread writes has the newest text, and its users never wait."""

import os
import threading

import pytest

from cell.records.kept_file import KeptFile
from tests.trouble import full_disk, until


@pytest.mark.parametrize("is_begun", [True, False])
def test_a_slow_disk_delays_nobody_and_the_newest_text_is_kept(tmp_path, monkeypatch, is_begun):
    goes_on, begun, written = threading.Event(), threading.Event(), []

    def fsync(number):
        begun.set()
        assert goes_on.wait(10.0)
        written.append(number)

    monkeypatch.setattr(os, "fsync", fsync)
    file = KeptFile(tmp_path / "part.json", "a thing")
    file.put("first", is_lasting=True)
    assert begun.wait(10.0) or not is_begun
    file.put("second", is_lasting=True)
    file.put("third", is_lasting=False)
    assert not file.flush(0.0)
    goes_on.set()
    assert file.flush(10.0)
    assert file.path.read_text() == "third"
    assert len(written) in ([2] if is_begun else [1, 2])


@pytest.mark.parametrize("is_void", [True, False])
def test_a_text_that_cannot_be_written_is_retried(tmp_path, caplog, is_void):
    file = KeptFile(tmp_path / "part.json", "a thing", is_void_if_late=is_void)
    file.put("first", is_lasting=False)
    assert file.flush(10.0)
    with full_disk():
        file.put("second", is_lasting=True)
        until(lambda: caplog.text)
        file.put("third", is_lasting=False)
        assert not file.flush(1.1)
        assert file.path.read_text() == ("" if is_void else "first")
    assert file.flush(10.0)
    assert file.path.read_text() == "third"
    assert caplog.text.count("cannot be kept") == 1
