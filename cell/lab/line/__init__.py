"""Study of the connection to a PLC."""
