"""The demonstration: injectors that a daemon observes in the same process, without a bench."""
