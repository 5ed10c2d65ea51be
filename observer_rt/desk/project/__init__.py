"""An engineer's week in one folder: files, fit, evaluation, discovery and report, made anew where a file changed."""
