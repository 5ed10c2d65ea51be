"""Frames in ASAM MDF4."""
