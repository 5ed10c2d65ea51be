"""Tier B of the discovery benchmark: plants unlike the model, which is fitted to each before it is asked."""
