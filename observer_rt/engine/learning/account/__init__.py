"""Account of what an injector may be, as values: hypotheses and their table, evidence, what masses are unsure by."""
