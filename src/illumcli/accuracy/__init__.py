"""Error against time: how far off a picture is, and how finely to sample for a given error."""
