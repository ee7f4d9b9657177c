"""The Franka hand behind its maker's client library."""
