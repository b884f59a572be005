"""The method `vertex`: channels sampled at the vertices."""

from __future__ import annotations

from illumcli.baking.at_points import channels_at
from illumcli.baking.context import BakeContext, VertexChannels
from illumcli.baking.vertex_points import vertex_points


def sampled_at_vertices(context: BakeContext) -> VertexChannels:
    """The channels that the settings ask for, at the vertices."""
    vertices = vertex_points(context.surfaces, context.threads)
    return VertexChannels(vertices, channels_at(context, vertices.points))
