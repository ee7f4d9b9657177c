"""Cells, presets and recipes as data: TOML files that ship with the program."""
