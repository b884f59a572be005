"""Descriptions of a scene: fields with ranges and messages, open families, and their documentation."""
