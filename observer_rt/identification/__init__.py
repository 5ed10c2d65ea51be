"""Models compared with recordings: likelihood, fit to a healthy injector, discovery of a missing effect."""
