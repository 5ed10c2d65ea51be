"""Export of a frozen observer and its model: C99, FMU, MATLAB, JSON."""
