"""Builds the devices that a config names, on hardware or in simulation, and checks each of them."""
