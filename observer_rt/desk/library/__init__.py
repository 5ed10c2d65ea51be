"""The package as a library: recordings, injectors, results and observers for notebooks and scripts."""
