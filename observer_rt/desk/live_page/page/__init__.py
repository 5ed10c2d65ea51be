"""What the live page shows: a session a browser, its files, and uPlot, which draws all curves."""
