"""The page for the line: the state of a cell in a browser, and its controls under the same lease as a PLC's."""
