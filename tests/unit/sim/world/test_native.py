"""The memory layout of MuJoCo that the exact contacts rely on is proved, and any other is refused."""

import logging
import re

import mujoco
import pytest

from sim.world import native


def test_the_pinned_release_is_laid_out_as_expected():
    native.verify_layout()


def test_another_release_is_refused(monkeypatch):
    monkeypatch.setattr(mujoco, "mj_versionString", lambda: "4.0.0")
    with pytest.raises(ImportError, match=r"mujoco 4\.0\.0 found, 3\.17\.0 needed"):
        native.verify_layout()


FIELDS = [name for name in dir(native) if re.fullmatch(r"(MODEL|DATA)_\w+|CONTACT_BYTES", name)]


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_that_has_moved_is_refused(name, monkeypatch):
    monkeypatch.setattr(native, name, getattr(native, name) + 8)
    with pytest.raises(ImportError, match="not laid out"):
        native.verify_layout()


@pytest.mark.parametrize("field", native.CONTACT_FIELDS)
def test_a_field_of_a_contact_that_has_moved_is_refused(field, monkeypatch):
    place, form = native.CONTACT_FIELDS[field]
    monkeypatch.setitem(native.CONTACT_FIELDS, field, (place + 4, form))
    with pytest.raises(ImportError, match="contacts are not laid out"):
        native.verify_layout()


BALL = "<mujoco><worldbody><body><freejoint/><geom size='0.01'/></body></worldbody></mujoco>"


def test_the_engine_s_warnings_go_to_the_log_and_nowhere_else(tmp_path, monkeypatch, capfd, caplog):
    monkeypatch.chdir(tmp_path)
    caplog.set_level(logging.DEBUG, "sim.world.native")
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    data.qvel[:] = 1e20
    native.log_warnings()
    mujoco.mj_step(model, data)
    assert "Nan, Inf or huge value in QVEL" in caplog.text
    assert (capfd.readouterr(), list(tmp_path.iterdir())) == (("", ""), [])
