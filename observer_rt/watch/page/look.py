"""Colours of the page."""

OBSERVER, NOMINAL, PAST, BAND = "#0b4f9e", "#d9730d", "#7f9fc4", "#9dc1ea"
SECOND, THIRD = "#188038", "#8e24aa"
NOT_VALID = "#b3261e"
