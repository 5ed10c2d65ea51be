"""The user's files: bench, links, effects, each refused with file, key and remedy."""
