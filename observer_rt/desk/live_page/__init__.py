"""The live page: traffic on the buses of a bench, read and drawn; no part of it belongs to the daemon."""
