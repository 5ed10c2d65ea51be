"""Recordings: reading, writing, replaying onto a bus."""
