"""Foundation that every room may use: the two kinds of failure, units, files, options."""
