"""The estimation engine: predictor, sensitivities, information, minimiser. Pure."""
