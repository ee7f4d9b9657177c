"""Every CAN bus and serial line of the house, their framing, and recorders of their traffic."""
