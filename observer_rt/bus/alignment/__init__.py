"""Alignment of frames to one gapless stream of samples, by index or by clock."""
