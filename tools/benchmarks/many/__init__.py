"""`tools/bench batch`: what many recordings cost, beside the compiled core alone."""
