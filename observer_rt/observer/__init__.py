"""The observer pair, its network, its learning and the published rate. Pure."""
