"""Evidence of events on disk: what a daemon keeps for whoever asks later what is missing."""
