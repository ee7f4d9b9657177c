"""A file that a thread keeps: a slow disk holds up nobody, and the newest text is what is in it."""

import os
import threading

import pytest

from cell.records.kept_file import KeptFile
from tests.trouble import full_disk, until


def test_whoever_changes_it_does_not_wait_for_the_disk(tmp_path, monkeypatch):
    goes_on, written = threading.Event(), []

    def fsync(number):
        written.append(number)
        assert goes_on.wait(10.0)

    monkeypatch.setattr(os, "fsync", fsync)
    file = KeptFile(tmp_path / "part.json", "a thing")
    file.put("first", is_lasting=True)
    file.put("second", is_lasting=True)
    file.put("third", is_lasting=False)
    assert not file.flush(0.0)
    goes_on.set()
    assert file.flush(10.0)
    assert file.path.read_text() == "third"
    assert 1 <= len(written) <= 2  # a text that is overtaken is not written


def test_a_text_that_has_to_last_is_not_overtaken_by_one_that_need_not(tmp_path, monkeypatch):
    goes_on, synced = threading.Event(), []

    def fsync(number):
        assert goes_on.wait(10.0)
        synced.append(number)

    monkeypatch.setattr(os, "fsync", fsync)
    file = KeptFile(tmp_path / "part.json", "a thing")
    file.put("first", is_lasting=True)
    while file._text is not None:
        pass
    file.put("second", is_lasting=True)
    file.put("third", is_lasting=False)
    goes_on.set()
    assert file.flush(10.0)
    assert (file.path.read_text(), len(synced)) == ("third", 2)


@pytest.mark.parametrize("is_void", [True, False])
def test_a_text_that_cannot_be_written_is_tried_again_and_an_older_one_voided_where_asked_for(
    tmp_path, caplog, is_void
):
    file = KeptFile(tmp_path / "part.json", "a thing", is_void_if_late=is_void)
    file.put("first", is_lasting=False)
    assert file.flush(10.0)
    with full_disk():
        file.put("second", is_lasting=True)
        until(lambda: file._text is not None and caplog.text)
        file.put("third", is_lasting=False)
        assert not file.flush(1.1)
        assert file.path.read_text() == ("" if is_void else "first")
    assert file.flush(10.0)
    assert file.path.read_text() == "third"
    assert caplog.text.count("cannot be kept") == 1
