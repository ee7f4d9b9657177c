"""The figures of a served cell as Prometheus text, read by a client of HTTP and the library's own parser."""

import urllib.request
from datetime import timedelta

import pytest
from prometheus_client.parser import text_string_to_metric_families

from cell.page.server import MetricsServer
from plc_bridge.protocol.intervals import Intervals
from plc_bridge.protocol.messages import Control
from tests.certificates import Authority
from tests.quick_cell import CODE
from tests.trouble import until


def read(address):
    with urllib.request.urlopen(f"http://{address[0]}:{address[1]}/metrics", timeout=10) as answer:
        families = list(text_string_to_metric_families(answer.read().decode()))
    return {(sample.name, *sample.labels.values()): sample.value for family in families for sample in family.samples}


def test_figures_are_those_of_the_cell(served, plc, loaded):
    plc.order((1, Control.NONE), (2, CODE))
    plc.until(lambda report: report.result != 0)
    plc.order((3, 77))
    with MetricsServer(("127.0.0.1", 0), served.bridge, loaded.cell) as server:
        address = server.address
        figures = read(address)
        until(lambda: read(address)["cell_scan_interval_seconds_count",] > figures["cell_scan_interval_seconds_count",])
    assert (figures["cell_insertions_total",], figures["cell_insertions_defective_total",]) == (1, 0)
    assert (figures["cell_refusals_total",], figures["cell_connections",]) == (1, 1)
    assert 0.0 < figures["cell_modbus_seconds_total",] < 10.0
    assert figures["cell_state", "complete"] == 1
    assert figures["cell_state_seconds_total", "execute"] > 0
    assert figures["cell_scan_interval_seconds_bucket", "+Inf"] == figures["cell_scan_interval_seconds_count",]


def test_the_age_of_the_keys_is_a_figure(served, loaded, tmp_path):
    tls = Authority(tmp_path / "keys").cell(lifetime=timedelta(days=50))
    cell = loaded.cell.model_copy(update={"plc": loaded.cell.plc.model_copy(update={"tls": tls})})
    with MetricsServer(("127.0.0.1", 0), served.bridge, cell) as server:
        assert read(server.address)["cell_key_days", "plc.tls.certificate"] == pytest.approx(50.0, abs=0.01)


def test_intervals_are_counted_in_their_ranges():
    intervals = Intervals()
    for now in (1.0, 1.01, 1.0115, 9.0):
        intervals.note(now)
    assert (intervals.counts[3], intervals.counts[0], intervals.counts[-1]) == (1, 1, 1)
    assert intervals.longest == pytest.approx(9.0 - 1.0115)
