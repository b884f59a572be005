"""The geometry of uv atlases: which texels triangles cover, gutters, overlaps, and making uv."""
