"""The observer over its stream of samples."""
