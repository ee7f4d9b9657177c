"""Roles come from the certificate, and wrong keys or settings are refused."""

import ssl

import pytest
from pydantic import ValidationError

from drivers.errors import DeviceNotOpenedError
from plc_bridge.modbus.tls import BadRoleError, rights_of, role_of, server_context
from tests.certificates import Authority, utf8


@pytest.fixture(scope="module")
def authority(tmp_path_factory):
    return Authority(tmp_path_factory.mktemp("certificates"))


def der(authority, *roles):
    return ssl.PEM_cert_to_DER_cert(authority.sign("client", *roles)[0].read_text())


@pytest.mark.parametrize("role", ["Operator", "Leitstand Süd", "x" * 64, ""])
def test_role_is_read_from_the_extension(authority, role):
    assert role_of(der(authority, *([utf8(role)] if role else []))) == role


@pytest.mark.parametrize(
    "value",
    [
        b"",
        b"Operator",
        b"\x13\x02AB",  # PrintableString
        utf8("AB") + utf8("CD"),
        b"\x30\x08" + utf8("AB") + utf8("CD"),
        b"\x0c\x02\xff\xfe",
        b"\x0c\x09AB",
        utf8(""),
        utf8("a\nb"),
        utf8("x" * 65),
    ],
)
def test_anything_but_one_printable_string_is_no_role(authority, value):
    with pytest.raises(BadRoleError, match=r"^its role [^\n]*$"):
        role_of(der(authority, value))
    with pytest.raises(BadRoleError):
        role_of(b"\x30\x00")


def test_role_that_the_table_does_not_name_may_do_nothing(authority):
    table = authority.cell(roles={"Operator": ["read", "command"]}, without_role=["read"])
    assert rights_of("Operator", table) == {"read", "command"}
    assert rights_of("operator", table) == frozenset()
    assert rights_of("", table) == {"read"}


@pytest.mark.parametrize("wrong", [{"roles": {"": ["read"]}}, {"roles": {"a": ["write"]}}, {"key": None}])
def test_wrong_settings_are_rejected(authority, wrong):
    with pytest.raises(ValidationError):
        authority.cell(**wrong)


def test_certificates_and_tls_1_2_are_required(authority):
    context = server_context(authority.cell())
    assert (context.verify_mode, context.minimum_version) == (ssl.CERT_REQUIRED, ssl.TLSVersion.TLSv1_2)


@pytest.mark.parametrize("key", ["certificate", "key", "authority"])
def test_file_that_is_missing_or_something_else_is_named(authority, tmp_path, key):
    settings = authority.cell(**{key: tmp_path / "odd.pem"})
    with pytest.raises(DeviceNotOpenedError, match=rf"^plc\.tls\.{key} = [^\n]*: No such file"):
        server_context(settings)
    (tmp_path / "odd.pem").touch(mode=0o600)
    (tmp_path / "odd.pem").write_text("odd")
    with pytest.raises(DeviceNotOpenedError, match=rf"^[^\n]*plc\.tls\.{key} = [^\n]*odd\.pem[^\n]*not a PEM"):
        server_context(settings)


def test_key_of_another_certificate_is_refused(authority):
    with pytest.raises(DeviceNotOpenedError, match="its own PEM key"):
        server_context(authority.cell(key=authority.sign("other")[1]))


@pytest.mark.parametrize("mode", [0o640, 0o620, 0o604, 0o602])
def test_key_that_is_open_to_others_is_refused_in_one_line(authority, mode):
    settings = authority.cell()
    for permitted in (0o600, 0o400):
        settings.key.chmod(permitted)
        assert server_context(settings)
    settings.key.chmod(mode)
    with pytest.raises(DeviceNotOpenedError, match=rf"^plc\.tls\.key = [^\n]*: mode {mode:o}: open to others[^\n]*$"):
        server_context(settings)
