"""Buffers kept between runs, and the fingerprints that they are known by."""
