"""Discovery: which physical effect is missing from the model? Check, find, name, add, show."""
