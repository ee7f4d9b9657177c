"""OPC UA: the cell as a PackML unit (OPC 30050) whose methods go through the handshake of all buses; optional."""
