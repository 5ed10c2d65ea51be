"""Vector ASC."""
