"""Error against time: the sampling error of an image, and the sampling that a given error needs."""
