"""Learning between injections: fit, belief, adequacy, intervals."""
