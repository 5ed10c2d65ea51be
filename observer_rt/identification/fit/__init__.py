"""Calibration of an injector's model, its structure included, to recordings of the healthy injector."""
