"""`tools/bench speed` and `tools/bench soak`: how fast, against whom, and for how long."""
