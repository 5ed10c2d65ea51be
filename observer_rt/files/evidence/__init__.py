"""Evidence of events on disk: kept by a daemon for a later search of the missing effect."""
