"""Recordings through the observer: traces, masses, comparison with nominal model and measurement."""
