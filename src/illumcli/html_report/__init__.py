"""A report of many pictures for a browser."""
