"""Quantities, contracts, faults and hardware; imports nothing else of this project."""
