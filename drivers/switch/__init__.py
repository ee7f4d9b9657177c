"""The board of the success switch: its wire, its driver and its firmware."""
