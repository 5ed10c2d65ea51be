"""Files that other programs' libraries read, whole: each module yields the columns of one kind."""
