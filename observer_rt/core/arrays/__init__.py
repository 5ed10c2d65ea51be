"""Loops over signals of recordings, and small matrices."""
