"""Image files: read, written, compared."""
