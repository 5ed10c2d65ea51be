"""What recordings show: standstill, openings, judged stretches, noise; and how well a model explains it."""
