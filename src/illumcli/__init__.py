"""Batch renderer for local illumination models and ambient obscurance, driven by YAML scenes."""

__version__ = "0.2.0"
