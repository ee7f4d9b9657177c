"""What `serve`, `check` and the figures report of open ports and of the age of keys."""

import logging
from datetime import timedelta

import pytest

from cell.commands.cli import FAULT, GOOD, main
from cell.run.exposure import SOON, exposures, key_days, key_verdict
from drivers.errors import DeviceNotOpenedError
from plc_bridge.config import ModbusConfig, PlcConfig, TlsConfig
from tests.certificates import Authority


def keys(authority, days=1.0, **more):
    certificate, key = authority.sign(f"cell-{days}", lifetime=timedelta(days=days))
    return TlsConfig(certificate=certificate, key=key, authority=authority.certificate, port=0, **more)


@pytest.fixture
def authority(tmp_path):
    return Authority(tmp_path / "keys")


def test_a_local_port_is_not_open():
    assert exposures(PlcConfig(), ("localhost", 8080), ("::1", 9464)) == []


def test_each_open_port_is_named_with_its_risk(authority):
    plc = PlcConfig(modbus=ModbusConfig(host="0.0.0.0"))
    modbus, page, metrics = exposures(plc, ("0.0.0.0", 8080), ("::", 9464))
    assert modbus.startswith("plc.modbus 0.0.0.0:5020: open to every computer")
    assert "the cell refuses the token, because [plc.tls] is missing" in page
    assert metrics.startswith("--metrics :::9464")
    allowed = ModbusConfig(host="0.0.0.0", allow=("10.0.0.0/8",))
    (page,) = exposures(PlcConfig(modbus=allowed, tls=keys(authority)), ("10.0.0.7", 8080))
    assert "has the token may move the cell" in page


def test_opc_ua_is_named_if_everybody_may_read():
    address = ("0.0.0.0", 4840)
    assert exposures(PlcConfig(), opcua=address) == []
    (line,) = exposures(PlcConfig(opcua_anonymous=True), opcua=address)
    assert line.startswith("--opcua 0.0.0.0:4840: open to every computer")


def test_the_age_of_every_key_is_reported(authority):
    days = key_days(keys(authority, 100.0, revoked=authority.revoke()))
    assert days["plc.tls.certificate"] == pytest.approx(100.0, abs=0.01)
    assert set(days) == {"plc.tls.certificate", "plc.tls.authority", "plc.tls.revoked"}
    assert key_days(None) == {}
    with pytest.raises(DeviceNotOpenedError, match=r"plc\.tls\.revoked = .*: not PEM"):
        key_days(keys(authority, revoked=authority.certificate))


@pytest.mark.parametrize(
    ("days", "told"),
    [
        (SOON + 1, "ok, 31 days left"),
        (SOON - 1, "expires in 29 days; more than 30 needed"),
        (-3.0, "expired 3 days ago"),
    ],
)
def test_a_key_is_good_until_it_soon_ends(days, told):
    assert key_verdict(days).startswith(told)


@pytest.mark.parametrize(("days", "status"), [(100.0, GOOD), (-1.0, FAULT)])
def test_check_reports_open_ports_and_the_age_of_keys(tmp_path, capsys, days, status):
    authority = Authority(tmp_path / "keys", lifetime=timedelta(days=100))
    tls = keys(authority, days)
    sets = [f'plc.tls.{name}="{getattr(tls, name)}"' for name in ("certificate", "key", "authority")]
    sets += ["plc.tls.port=0", "plc.modbus.port=0", 'plc.modbus.host="0.0.0.0"', "sim.pace=max"]
    arguments = [word for each in sets for word in ("--set", each)]
    assert main(["check", "--json", *arguments]) == status
    found = capsys.readouterr().out
    assert "ok, but plc.modbus 0.0.0.0:0: open to every computer" in found
    assert ("99 days left" if days > 0 else "expired 1 days ago") in found or "100 days left" in found
    logging.getLogger().handlers.clear()
