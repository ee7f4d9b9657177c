"""A file that a thread keeps: a slow disk holds up nobody, and the newest text is what is in it."""

import os
import threading

import pytest

from cell.records.kept_file import KeptFile
from tests.trouble import full_disk, until


@pytest.mark.parametrize("is_begun", [True, False])
def test_whoever_changes_it_does_not_wait_for_the_disk_and_a_text_that_has_to_last_is_not_overtaken(
    tmp_path, monkeypatch, is_begun
):
    """A text is overtaken by a newer one unless the disk has begun to write it, or it has to last and the newer one need not."""
    goes_on, written = threading.Event(), []

    def fsync(number):
        assert goes_on.wait(10.0)
        written.append(number)

    monkeypatch.setattr(os, "fsync", fsync)
    file = KeptFile(tmp_path / "part.json", "a thing")
    file.put("first", is_lasting=True)
    while is_begun and file._text is not None:
        pass
    file.put("second", is_lasting=True)
    file.put("third", is_lasting=False)
    assert not file.flush(0.0)
    goes_on.set()
    assert file.flush(10.0)
    assert file.path.read_text() == "third"
    assert len(written) in ([2] if is_begun else [1, 2])


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
