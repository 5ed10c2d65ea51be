"""The live page's question for what is missing: evidence, search, finding, taking over and undoing."""
