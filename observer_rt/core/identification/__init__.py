"""Loops over measured signals: the true seat areas of a lift."""
