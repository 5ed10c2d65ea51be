"""The observer at every sample: dead band, events, the pair. Compiled."""
