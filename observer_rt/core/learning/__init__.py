"""What learning does with every sample of an event."""
