"""Recordings as signals over time: CSV and MDF4."""
