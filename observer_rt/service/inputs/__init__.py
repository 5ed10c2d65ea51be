"""Optional inputs: fuel temperature, energizing, measured mass, learning switch."""
