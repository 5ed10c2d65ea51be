"""Models against recordings: how far off, where, in single injections and with the needle shut."""
