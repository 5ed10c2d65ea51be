"""Laws and results of a search in words, formulas and entries of findings.json."""
