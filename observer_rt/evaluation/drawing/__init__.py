"""Pictures of evaluated recordings."""
