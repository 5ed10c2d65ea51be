"""Which column of a file is which signal, guessed from names, units and what they do."""
