"""The terminal: results and progress, files that can be written, stopping on request."""
