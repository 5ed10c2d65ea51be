"""Which effect is missing: fits, candidates, verdict."""
