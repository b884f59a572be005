"""Scenes live in a browser: a local page, its server, and a session for each window."""
