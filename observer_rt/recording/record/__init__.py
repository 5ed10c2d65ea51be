"""From a bus into log files."""
