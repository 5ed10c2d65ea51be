"""Models of the feed line, one file each; `line.model` of the injector file chooses one by name."""
