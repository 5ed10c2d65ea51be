"""Bus databases: looked up, read from files, compiled into a codec; end-to-end protection."""
