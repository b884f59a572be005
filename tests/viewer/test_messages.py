"""Messages that take the place of earlier ones."""

from __future__ import annotations

import pytest

from illumcli.viewer.messages import coalesced


def test_moves_add_up_and_the_last_value_counts():
    messages = [
        {"type": "move", "orbit": [0.1, 0.2], "dragging": True, "stamp": 1},
        {"type": "move", "orbit": [0.3, -0.2], "dragging": True, "stamp": 2},
        {"type": "move", "dolly": 0.5},
        {"type": "move", "dolly": 0.25, "stamp": 4},
        {"type": "set", "path": "a", "value": 1},
        {"type": "set", "path": "a", "value": 2},
        {"type": "set", "path": "b", "value": 3},
        {"type": "view", "layer": "depth", "stamp": 5},
        {"type": "view", "camera": "top", "stamp": 6},
    ]
    assert coalesced(messages) == [
        {"type": "move", "orbit": [0.4, 0.0], "dragging": True, "stamp": 2},
        {"type": "move", "dolly": 0.75, "stamp": 4},
        {"type": "set", "path": "a", "value": 2},
        {"type": "set", "path": "b", "value": 3},
        {"type": "view", "layer": "depth", "camera": "top", "stamp": 6},
    ]


@pytest.mark.parametrize("first", ["left", [1], [[1], 2], 10**400, None])
def test_what_is_no_motion_stays_apart(first):
    messages = [{"type": "move", "orbit": first}, {"type": "move", "orbit": [0.5, 0.5]}]
    assert coalesced(messages) == messages


def test_others_stay_apart():
    messages = [
        {"type": "set", "path": "a", "value": 1},
        {"type": "reset", "path": "a"},
        {"type": "set", "path": "a", "value": 1},
        {"type": "move", "orbit": [1, 0]},
        {"type": "move", "pan": [1, 0]},
        {"type": "move", "orbit": [1, 0]},
        {"type": "pick", "x": 0, "y": 0},
        {"type": "pick", "x": 0, "y": 0},
    ]
    assert coalesced(messages) == messages
