"""A scene with edits, as a session keeps them, and random use of its controls."""

from __future__ import annotations

from hypothesis import strategies as st

from illumcli.errors import InputError
from illumcli.scene.load import load, read_text
from illumcli.viewer.controls import controls
from illumcli.viewer.edits import after_reset, after_set, overrides_of

REFUSALS = ("which only its author knows", "near must be below far", "must differ", "zero vector")


class Window:
    """A scene with edits, as a session keeps them."""

    def __init__(self, path):
        self.path, self.text, self.edits = path, read_text(path), {}
        self.original = self.now = load(path, (), self.text)

    def set(self, path, value):
        edits = after_set(self.original, self.now, self.edits, path, value)
        self.now = load(self.path, overrides_of(edits), self.text)
        self.edits = edits
        return self.now.scene

    def reset(self, path=None):
        self.edits = after_reset(self.original, self.now, self.edits, path)
        self.now = load(self.path, overrides_of(self.edits), self.text)
        return self.now.scene

    def use(self, data):
        """Set a random control; the control, or None if it was refused for a good reason, and the value."""
        found = {each.path: each for each in controls(self.original, self.now)}
        control = found[data.draw(st.sampled_from(sorted(found)))]
        value = value_for(data, control)
        try:
            self.set(control.path, value)
        except InputError as error:
            if any(each in str(error) for each in REFUSALS):
                return None, value
            raise
        return control, value


def value_for(data, control):
    """A value that the page could set with a control."""
    match control.kind:
        case "switch":
            return data.draw(st.booleans())
        case "choice":
            return data.draw(st.sampled_from(control.choices))
        case "integer":
            return data.draw(st.integers(int(control.minimum), int(control.maximum)))
        case "number":
            return data.draw(st.floats(control.minimum, control.maximum))
        case "color" | "vector":
            size = len(control.value or (0, 0, 0))
            number = st.floats(control.minimum, control.maximum)
            return data.draw(st.lists(number, min_size=size, max_size=size))
    return control.value
