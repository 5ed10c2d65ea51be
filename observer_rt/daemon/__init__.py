"""The daemon: core on frames, loop, states, persistence."""
