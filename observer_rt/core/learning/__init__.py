"""Loops of learning over the samples of an event."""
