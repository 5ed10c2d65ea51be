"""`tools/bench faults`: everything that may go wrong on a bench, at random times; are valid results right?"""
