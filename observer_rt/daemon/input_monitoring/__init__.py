"""What is wrong with what comes in: messages that stay away, odd values, other senders of our results."""
