"""Parameters of a PLC's command: keys of the config that it may replace for its own run."""

from plc_bridge.protocol.registers import Parameter

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("grasp.force", "N", 0.1, 1.0, 70.0, "grip force"),
    Parameter("search.speed", "m/s", 1e-4, 0.001, 0.5, "peak speed of the tip while it searches"),
    Parameter("search.timeout", "s", 0.1, 1.0, 600.0, "longest search"),
    Parameter("insert.timeout", "s", 0.1, 1.0, 600.0, "longest insertion"),
    Parameter("adjust.timeout", "s", 0.1, 1.0, 600.0, "longest adjustment"),
)
"""Keys of the config that a command may replace for its own run."""
