"""The line to the PLC: words in, words out, and a handshake that runs each command at most once."""
