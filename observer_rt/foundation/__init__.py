"""What every room may use: the two kinds of failure, units, words of continuity, the cache of compiled code."""
