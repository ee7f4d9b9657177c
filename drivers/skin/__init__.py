"""Skin boards: wires, dialogues, health, layout and calibration of the taxels."""
