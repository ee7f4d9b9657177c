"""Wires every part into a cell; no other package imports it."""
