"""Counters and timings of cell and servers as Prometheus text."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from itertools import accumulate

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from cell.run.exposure import key_days
from cell.run.states import State
from drivers.errors import DeviceNotOpenedError
from plc_bridge.bridge import Bridge, Figures
from plc_bridge.config import TlsConfig
from plc_bridge.protocol.intervals import BOUNDS
from plc_bridge.protocol.registers import table

KIND = CONTENT_TYPE_LATEST
"""Media type of the text."""


class CellCollector(Collector):
    """Reads the bridge only when the metrics are requested."""

    def __init__(self, bridge: Bridge, tls: TlsConfig | None) -> None:
        """Keep the bridge, and the keys of the cell."""
        self._bridge, self._tls = bridge, tls
        self._said = {r.name: r.meaning for r in table() if r.name.startswith("diagnostics_")}
        self._registry = CollectorRegistry()
        self._registry.register(self)

    def text(self) -> bytes:
        """Return every metric as text of `KIND`."""
        return generate_latest(self._registry)

    def collect(self) -> Iterator[Metric]:
        """Yield every metric with its present value."""
        figures = self._bridge.figures
        for name, value in asdict(figures.counts).items():
            # These diagnostics can decrease.
            kind = GaugeMetricFamily if name in ("connections", "stops_held") else CounterMetricFamily
            yield kind(f"cell_{name}", self._said[f"diagnostics_{name}"], value=value)
        said = "time that the Modbus TCP servers spent on requests"
        yield CounterMetricFamily("cell_modbus_seconds", said, value=figures.served)
        yield CounterMetricFamily("cell_insertions", "insertions that have ended", value=figures.tags.processed)
        said = "insertions that did not end in success"
        yield CounterMetricFamily("cell_insertions_defective", said, value=figures.tags.defective)
        yield from _states(figures)
        yield from _scans(figures)
        keys = GaugeMetricFamily(
            "cell_key_days", "time for which a file of the keys is still valid, days", labels=["file"]
        )
        with suppress(DeviceNotOpenedError):
            for name, days in key_days(self._tls).items():
                keys.add_metric([name], days)
        yield keys


def _states(figures: Figures) -> Iterator[Metric]:
    now = GaugeMetricFamily("cell_state", "1 for the PackML state that the cell is in", labels=["state"])
    times = CounterMetricFamily("cell_state_seconds", "time in each PackML state", labels=["state"])
    for state in State:
        now.add_metric([state.name.lower()], float(state.value == figures.tags.state))
        times.add_metric([state.name.lower()], figures.tags.times[state.value - 1])
    yield now
    yield times


def _scans(figures: Figures) -> Iterator[Metric]:
    bounds, below = (*map(str, BOUNDS), "+Inf"), map(float, accumulate(figures.intervals.counts))
    buckets = list(zip(bounds, below, strict=True))
    said = "time from one scan to the next"
    yield HistogramMetricFamily("cell_scan_interval_seconds", said, buckets=buckets, sum_value=figures.intervals.total)
    longest = "longest time from one scan to the next since the start"
    yield GaugeMetricFamily("cell_scan_interval_longest_seconds", longest, value=figures.intervals.longest)
