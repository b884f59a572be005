"""Error against time: how far an image is from its limit, and how finely to sample for a given error."""
