"""Runs the cell: states, orders, one program at a time, and stops."""
