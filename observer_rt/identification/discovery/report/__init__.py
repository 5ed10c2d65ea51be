"""The answer for people: page, tables, figures, words."""
