"""The success switch's board: its wire, its driver and its firmware."""
