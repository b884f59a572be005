"""Obscurance at the vertices of meshes: where it is asked for, sampled, fitted and written."""
