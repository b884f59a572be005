"""Ambient obscurance at the vertices of meshes: sampled, fitted and written."""
