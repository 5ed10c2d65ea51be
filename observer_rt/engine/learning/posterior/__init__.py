"""One event: what it may be, weighed by all hypotheses of the account, and all that follows from the posterior."""
