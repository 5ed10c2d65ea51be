"""Findings of `observer-rt check` about a bench, without touching its bus."""
