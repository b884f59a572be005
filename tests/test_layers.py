"""Layers and the names of users: nothing collides."""

from __future__ import annotations

import pytest

from illumcli.film.preview import PREVIEWS
from illumcli.layers import (
    CHANNEL_GROUPS,
    FIXED,
    NAMES,
    PER_LIGHT,
    layer_of_channel,
    owner_of,
)


def groups(layers):
    return {channel.rpartition(".")[0] or channel for layer in layers for channel in layer.channels}


@pytest.mark.parametrize("name", [*NAMES, *CHANNEL_GROUPS, "Beauty", "DEPTH", "shadow"])
def test_a_light_may_not_have_the_name_of_a_layer_or_of_its_channels(name):
    assert owner_of(name) in NAMES


@pytest.mark.parametrize("name", ["key", "n", "r", "a", "Z1", "beauty2", "Shadow", "point1", "_"])
def test_other_names_share_neither_layer_nor_channels(name):
    assert owner_of(name) is None
    own = [row.of(name) for row in PER_LIGHT.values()]
    assert not {layer.name.casefold() for layer in own} & {layer.casefold() for layer in FIXED}
    assert not groups(own) & groups(FIXED.values())
    assert not {layer.buffer for layer in own} & {layer.buffer for layer in FIXED.values()}


def test_every_channel_is_of_one_layer():
    channels = [channel for layer in FIXED.values() for channel in layer.channels]
    assert len(channels) == len(set(channels))


def test_a_name_is_a_layer_or_stands_for_one_of_each_light():
    assert sorted(NAMES) == sorted([*FIXED, *PER_LIGHT])
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize(
    "layer",
    [*FIXED.values(), *(row.of(name) for row in PER_LIGHT.values() for name in ("key", "key.fill_id"))],
)
def test_a_channel_leads_to_its_layer(layer):
    for channel in layer.channels:
        assert layer_of_channel(channel) == layer


def test_every_layer_can_be_shown_and_has_a_buffer_in_some_scene(root):
    from illumcli.render_graph.build import build
    from illumcli.scene.load import load

    assert {layer.preview for layer in FIXED.values()} == set(PREVIEWS)
    buffers = set()
    for path in sorted((root / "scenes").glob("*.yaml")):
        loaded = load(path)
        nodes = build(loaded.scene, loaded).nodes
        buffers |= set(nodes)
        for light in loaded.scene.named_lights():
            assert {row.of(light).buffer for row in PER_LIGHT.values()} <= set(nodes), path
    assert {layer.buffer for layer in FIXED.values()} <= buffers
