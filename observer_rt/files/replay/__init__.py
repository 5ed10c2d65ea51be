"""A recording or a log as frames onto a bus."""
