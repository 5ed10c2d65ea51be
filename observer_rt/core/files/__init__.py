"""Loops over recordings: records of a file."""
