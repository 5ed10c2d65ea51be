"""Likelihood of models: standstill, openings, judged stretches and noise of recordings, whitened residuals."""
