"""Layers and the names of users: nothing collides."""

from __future__ import annotations

import pytest

from illumcli.layers import CHANNEL_GROUPS, FIXED, PER_LIGHT, of_light, owner_of, shadow_of


def groups(layers):
    return {channel.rpartition(".")[0] or channel for layer in layers for channel in layer.channels}


@pytest.mark.parametrize("name", [*FIXED, *PER_LIGHT, *CHANNEL_GROUPS, "Beauty", "DEPTH", "shadow"])
def test_a_light_may_not_have_the_name_of_a_layer_or_of_its_channels(name):
    assert owner_of(name) in (*FIXED, *PER_LIGHT)


@pytest.mark.parametrize("name", ["key", "n", "r", "a", "Z1", "beauty2", "Shadow", "point1", "_"])
def test_other_names_share_neither_layer_nor_channels(name):
    assert owner_of(name) is None
    own = [of_light(name), shadow_of(name)]
    assert not {layer.name.casefold() for layer in own} & {layer.casefold() for layer in FIXED}
    assert not groups(own) & groups(FIXED.values())
    assert not {layer.buffer for layer in own} & {layer.buffer for layer in FIXED.values()}


def test_every_channel_is_of_one_layer():
    channels = [channel for layer in FIXED.values() for channel in layer.channels]
    assert len(channels) == len(set(channels))
