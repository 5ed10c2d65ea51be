"""What `observer-rt check` says of a bench, without touching its bus."""
