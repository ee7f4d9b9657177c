"""The CANopen node: objects, PDOs, SDOs, heartbeats and emergencies."""
