"""Files that a PLC's programming tool imports, generated from the register table."""
