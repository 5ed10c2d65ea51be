"""Simulated injections: needle motion and recordings of healthy or worn injectors."""
