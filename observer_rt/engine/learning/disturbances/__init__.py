"""Disturbances that a bench puts on the signals: noise of any colour, outliers, ends of range, offsets and gains."""
