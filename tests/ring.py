"""A scene with a torus on a disc, for tests of errors."""

from __future__ import annotations

RING = """
version: 1
film: {{width: 64, height: 36, samples: {samples}}}
ambient: {ambient}
obscurance: {{samples: 4}}
objects: [{{mesh: {{shape: torus}}}}, {{mesh: {{shape: disc, radius: 4}}}}]
lights: [{{light: point, position: [3, 4, 5], intensity: 30}}]
"""
