"""Keeps what happened: runs, samples, configs and states on disk, and reads them back."""
