"""Both ways to command the cell over Modbus, recorded on a socket and drawn as timing diagrams."""
