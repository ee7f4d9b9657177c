"""The line to the PLC: words in, words out, and a handshake that never runs a command twice."""
