"""Emulated boards with the real firmware or protocol behind a wire."""
