"""Compiled path from a received frame to the frames it causes."""
