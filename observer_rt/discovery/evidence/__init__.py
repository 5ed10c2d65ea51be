"""What recordings show: standstill, openings, judged stretches, noise."""
