"""Searches for the missing effect: fits, candidates, verdict."""
