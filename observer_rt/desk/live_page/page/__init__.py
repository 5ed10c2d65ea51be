"""Content of the live page: a session a browser, its files, and uPlot, which draws all curves."""
