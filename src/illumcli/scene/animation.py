"""A scene at a frame: its tree with the value of every curve, and the file of every sequence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from illumcli.records import Value
from illumcli.scene.access import file_inside, is_path
from illumcli.scene.curves import CURVES
from illumcli.scene.curves._base import Curve
from illumcli.scene.extend import CHOICES
from illumcli.scene.faults import faults
from illumcli.scene.frames import FRAMES_PER_SECOND, Frames, Moment
from illumcli.scene.problems import problem_at
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.source import Node, Problem
from illumcli.scene.source import Path as Steps
from illumcli.scene.yaml_text import flow
from illumcli.schema.families import member
from illumcli.schema.messages import short

MAX_TABLE_BYTES = 2**26
TAG = "curve"


class TableFiles:
    """The texts of files that curves name: each is read once for all frames of a scene."""

    def __init__(self) -> None:
        self._texts: dict[Path, str] = {}

    @property
    def files(self) -> list[Path]:
        """The files that were read."""
        return list(self._texts)

    def text(self, path: Path) -> str:
        """The text of a file.

        Raises
        ------
        ValueError
            It cannot be read, or is too large.
        """
        if path not in self._texts:
            try:
                with path.open("rb") as file:
                    data = file.read(MAX_TABLE_BYTES + 1)
                if len(data) > MAX_TABLE_BYTES:
                    raise ValueError(f"{path} is larger than {MAX_TABLE_BYTES} bytes; split it")
                self._texts[path] = data.decode("utf-8-sig")
            except (OSError, UnicodeDecodeError) as error:
                fact = getattr(error, "strerror", None) or error
                raise ValueError(f"{path} cannot be read: {fact}") from None
        return self._texts[path]


class Surroundings(Value):
    """What the curves of a scene may read."""

    folder: Path
    roots: tuple[Path, ...]
    tables: TableFiles

    def read(self, text: str) -> tuple[Path, str]:
        """The file that a path in the scene names, and its text."""
        file = file_inside(text, self.folder, self.roots)
        if isinstance(file, str):
            raise ValueError(file)
        return file, self.tables.text(file)


class AtFrame(Value):
    """A scene's tree at a frame."""

    tree: Node
    frame: int
    varying: tuple[Steps, ...] = ()
    """The paths of the values that curves and sequences gave."""
    faulty: tuple[Steps, ...] = ()
    """The paths of curves that remain in the tree, because they have faults."""
    problems: tuple[Problem, ...] = ()

    def said(self, path: Steps, fact: str) -> str:
        """The text of a fault at `path`; it names the frame if the fault concerns a value that varies."""
        if not any(path[: len(each)] == each or each[: len(path)] == path for each in self.varying):
            return fact
        node = self.tree.find(path)
        if fact.endswith("is a mapping") and node and isinstance(node.value, dict) and "phi" in node.value:
            fact = "maps vary it over the surface, and only parameters of materials may; leave them out"
        if fact.startswith("must be a whole number"):
            fact += "; whole numbers have curve: step"
        return f"at frame {self.frame}: {fact}"


def frames_of(tree: Node) -> Frames | None:
    """The frames of a scene; None if it has none, or faulty ones, which its validation reports."""
    node = tree.find(("frames",))
    if node is None or node.value is None:
        return None
    try:
        return Frames.model_validate(node.plain())
    except ValidationError:
        return None


def at_frame(tree: Node, frame: int | None, surroundings: Surroundings) -> AtFrame:
    """The tree of a scene at a frame: plain values in place of curves and sequences.

    Parameters
    ----------
    frame : int, optional
        By default the first of the scene's frames; a scene without any must not vary.
    """
    frames = frames_of(tree)
    moment = None
    if frame is None and frames is not None:
        frame = frames.first
    if frame is not None:
        fps = frames.fps if frames else FRAMES_PER_SECOND
        moment = Moment(frame, frame / fps, fps)
    evaluation = _Evaluation(moment, surroundings)
    tree = evaluation.node(tree, ()) if _may_vary(tree) else tree
    if moment is None and "frames" in (tree.value if isinstance(tree.value, dict) else ()):
        evaluation.problems.clear()  # these frames are faulty, which the validation of the scene reports
    return AtFrame(
        tree, frame or 0, tuple(evaluation.varying), tuple(evaluation.faulty), tuple(evaluation.problems)
    )


def overrides_of_frame(loaded: SceneFile) -> list[str]:
    """The values that vary, at the frame of a scene, in the form of `-D`."""
    values = {path: loaded.tree.find(path) for path in loaded.varying}
    return [
        f"{'.'.join(map(str, path))}={flow(None if node is None else node.plain())}"
        for path, node in values.items()
    ]


def _may_vary(node: Node) -> bool:
    """False if no part of a node is a curve or the path of a sequence."""
    value = node.value
    if isinstance(value, dict):
        return TAG in value or any(map(_may_vary, value.values()))
    if isinstance(value, list):
        return any(map(_may_vary, value))
    return isinstance(value, str) and "#" in value


class _Evaluation:
    """Evaluates the curves and sequences of a tree."""

    def __init__(self, moment: Moment | None, surroundings: Surroundings) -> None:
        self.moment, self.surroundings = moment, surroundings
        self.varying: list[Steps] = []
        self.faulty: list[Steps] = []
        self.problems: list[Problem] = []

    def node(self, node: Node, path: Steps) -> Node:
        """The node at `path` at the moment; the node itself if nothing in it varies."""
        match node.value:
            case _ if path == ("frames",):
                return node
            case dict() if is_curve(node):
                return self.curve(node, path)
            case dict(entries):
                mapping = {key: self.node(part, (*path, key)) for key, part in entries.items()}
                is_same = all(mapping[key] is part for key, part in entries.items())
                return node if is_same else replace(node, value=mapping)
            case list(parts):
                listed = [self.node(part, (*path, index)) for index, part in enumerate(parts)]
                is_same = all(new is part for new, part in zip(listed, parts, strict=True))
                return node if is_same else replace(node, value=listed)
            case str(text) if self.moment is not None and "#" in text and is_path(path, text):
                curve = Node({"curve": Node("sequence", node.place), "file": node}, node.place, node.key)
                return self.curve(curve, path)
        return node

    def curve(self, node: Node, path: Steps) -> Node:
        """The value of a curve; the curve itself if it has a fault."""
        if self.moment is None:
            advice = "add frames: {last: 47}, or give --frames 0:47"
            fact = f"varies with the frame, and there are no frames; {advice}"
            return self.refuse(node, path, node, (), fact)

        # Validate the curve.
        plain = node.plain()
        try:
            cls = member(CURVES, plain[TAG])
        except LookupError as error:
            fact = f"no curve '{short(plain[TAG])}'; {error}"
            return self.refuse(node, path, node, (TAG,), fact)
        try:
            curve: Curve = cls.model_validate(plain)
        except ValidationError as error:
            for inside, fact in faults(error, cls, plain):
                self.refuse(node, path, node.find(inside) or node, inside, fact)
            return node

        # Evaluate it; a value that is written in the scene keeps its own place.
        key = curve.key_at(self.moment)
        written = node.find(("keys", key)) if key is not None else None
        if written is None:
            try:
                value = curve.value_at(self.moment, self.surroundings.read)
            except ValueError as error:
                return self.refuse(node, path, node, (), f"at frame {self.moment.frame}: {error}")
            written = _placed(value, node)
        self.varying.append(path)
        return self.node(replace(written, key=node.key and written.at), path)

    def refuse(self, node: Node, path: Steps, at: Node, inside: Steps, fact: str) -> Node:
        """Note a fault of a curve, at a place inside of it. Returns the curve."""
        self.faulty.append(path)
        self.problems.append(problem_at(at.at, (*path, *inside), fact))
        return node


def is_curve(node: Node) -> bool:
    """True if a node is a mapping whose tag is `curve`; `{F: material, curve: schlick}` has another."""
    entries = node.value
    return (
        isinstance(entries, dict)
        and TAG in entries
        and isinstance(entries[TAG].value, str)
        and not any(tag in entries for tag in CHOICES)
    )


def _placed(value: Any, curve: Node) -> Node:
    """The value of a curve as a node at the curve's place; maps keep their own node."""
    if isinstance(value, Mapping):
        given = curve.value if isinstance(curve.value, dict) else {}
        parts = {name: given[name] if name in given else _placed(part, curve) for name, part in value.items()}
        return Node(dict(parts), curve.place)
    if isinstance(value, list | tuple):
        return Node([_placed(part, curve) for part in value], curve.place)
    return Node(value, curve.place)
