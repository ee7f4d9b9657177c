"""Every CAN bus and serial line of this project, their framing, and recorders of their traffic."""
