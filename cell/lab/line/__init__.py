"""Study of the line to a PLC."""
