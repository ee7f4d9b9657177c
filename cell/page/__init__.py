"""The page for the line: what a cell does, shown in a browser, and its controls under the same lease as a PLC's."""
