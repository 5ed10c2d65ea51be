"""The simulated injector."""
