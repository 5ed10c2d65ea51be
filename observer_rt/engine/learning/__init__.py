"""What happens between injections: fit, belief, adequacy, intervals."""
