"""Faults of the inputs: messages that stay away, odd values, other senders of our results."""
