"""Events judged, what is said of their injections, and who hears it."""
