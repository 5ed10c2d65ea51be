"""CAN: databases, compiled codec, end-to-end protection, alignment, links."""
