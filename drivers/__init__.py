"""Quantities, contracts, faults and hardware drivers; the package imports no other package of this project."""
