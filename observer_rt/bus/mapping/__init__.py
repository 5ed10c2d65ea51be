"""Mapping of bench file and bus database to arrays: which frames carry what."""
