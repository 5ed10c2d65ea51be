"""Frames in, frames out: no socket, no clock, no file."""
