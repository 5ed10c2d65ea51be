"""CAN logs: one module a format, and what they hold."""
