"""One study, one chart: speed against accuracy."""
