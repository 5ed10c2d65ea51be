"""The live page: what is on the buses of a bench, listened to and drawn; nothing of it is part of the daemon."""
