"""Wires every part into a cell; imported by nobody."""
