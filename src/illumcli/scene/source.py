"""YAML text -> a tree of plain data, in which every node has its line and column.

The text is read as events, so that depth, size and repetition are limited before anything is built. Scalars
follow the core schema of YAML 1.2: `1e3` is a number, `012` is twelve, and `no`, `1:30` and dates are text.
PyYAML itself follows YAML 1.1 and keeps the last of two equal keys. No other module imports it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeAlias

import yaml

from illumcli.schema.messages import short

MAX_BYTES = 2**20
MAX_DEPTH = 32
MAX_NODES = 100_000
MAX_ALIASES = 100
MAX_GROWTH = 10
MAX_DIGITS = 64

Path: TypeAlias = tuple[str | int, ...]  # keys and list indices from the top of the scene
Scalar: TypeAlias = str | int | float | bool | None

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f]")
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_NUMERIC = frozenset("+-.0123456789")
"""What a number begins with, finite or not."""
_UNQUOTED = re.compile(r"[ \t]*(#[0-9A-Fa-f]{3,8})[ \t]*\r?$", re.MULTILINE)
_WORDS: dict[str, Scalar] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_ADVICE = (  # part of the parser's message -> what most often helps
    ("cannot start any token", "indent with spaces, not tabs, and quote text that begins with a sign"),
    ("mapping values are not allowed", "check the indentation, and quote text that holds ': '"),
    ("expected ':'", "write `key: value`"),
    ("expected key", "check the indentation"),
    ("<block end>", "check the indentation"),
    ("quoted scalar", "close the quote"),
    ("',' or", "close the bracket, or put a comma between its parts"),
    ("alias", "write `&name` and `*name`, or quote text that begins with * or &"),
)


class Place(NamedTuple):
    """A place in a file, with line and column from 1; line 0 means that `source` is an override."""

    source: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.source}:{self.line}:{self.column}" if self.line else self.source


class Problem(NamedTuple):
    """One fault: its place, the path of the part of the scene that it concerns, and what is wrong."""

    place: Place
    path: Path
    fact: str

    def __str__(self) -> str:
        parts = (str(self.place), ".".join(map(str, self.path)), self.fact)
        line = ": ".join(part for part in parts if part)
        return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in line)


@dataclass(slots=True)
class Node:
    """A part of a document: a scalar, a list of nodes, or a mapping from keys to nodes. Read-only."""

    value: Scalar | list[Node] | dict[str, Node]
    place: Place
    key: Place | None = None  # place of its key, if it is in a mapping
    size: int = 1  # number of nodes, with aliases expanded
    depth: int = 1

    @property
    def at(self) -> Place:
        """The place that messages name: of its key if it has one, otherwise its own."""
        return self.key or self.place

    def plain(self) -> Any:
        """The value as dict, list, str, int, float, bool and None."""
        match self.value:
            case dict(entries):
                return {key: node.plain() for key, node in entries.items()}
            case list(entries):
                return [node.plain() for node in entries]
            case scalar:
                return scalar

    def find(self, path: Path) -> Node | None:
        """The node at `path`; None if there is none."""
        node: Node | None = self
        for step in path:
            match node.value if node else None, step:
                case dict(entries), str(key):
                    node = entries.get(key)
                case list(entries), int(index) if index < len(entries):
                    node = entries[index]
                case _:
                    return None
        return node

    def places(self, path: Path = ()) -> Iterator[tuple[Path, Node]]:
        """All nodes with their paths, in the order of the text."""
        yield path, self
        match self.value:
            case dict(entries):
                for key, node in entries.items():
                    yield from node.places((*path, key))
            case list(entries):
                for index, node in enumerate(entries):
                    yield from node.places((*path, index))


def read(text: bytes, name: str, fixed: Place | None = None) -> tuple[Node | None, list[Problem]]:
    """The document in `text`, and all problems; faulty scalars remain in it as text.

    Parameters
    ----------
    text : bytes
        UTF-8, at most 1 MiB.
    name : str
        Name of the file in places.
    fixed : Place, optional
        The place of all nodes, instead of line and column: for the value of an override.

    Returns
    -------
    node : Node or None
        None if the problems left no document.
    problems : list of Problem
    """
    # Refuse what is not a small text file.
    place = fixed or Place(name, 1, 1)
    if len(text) > MAX_BYTES:
        return None, [Problem(place, (), f"larger than {MAX_BYTES} bytes; a scene is a small text file")]
    try:
        decoded = text.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = text[: error.start].decode("utf-8-sig")
        at = fixed or _place_after(before, name)
        return None, [Problem(at, (), f"byte 0x{text[error.start]:02x} is not UTF-8; save the file as UTF-8")]
    if control := _CONTROL.search(decoded):
        at = fixed or _place_after(decoded[: control.start()], name)
        return None, [Problem(at, (), f"character U+{ord(control[0]):04X} is not text; remove it")]

    composer = _Composer(decoded, lambda mark: fixed or Place(name, mark.line + 1, mark.column + 1))
    return composer.document(place), composer.problems


def _place_after(text: str, name: str) -> Place:
    return Place(name, text.count("\n") + 1, len(text) - text.rfind("\n"))


class _Refused(Exception):
    """A fault that ends the reading of the text."""


@dataclass
class _Composer:
    """Builds nodes from events. The methods for nodes begin after the event that opens the node."""

    text: str
    place: Callable[[Any], Place]
    problems: list[Problem] = field(default_factory=list)
    anchors: dict[str, Node | None] = field(default_factory=dict)  # None while it is being built
    written: int = 0  # nodes in the text
    nodes: int = 0  # nodes with aliases expanded
    aliases: int = 0

    def document(self, start: Place) -> Node | None:
        """The document; None if it cannot be read, which is added to `problems`."""
        try:
            return self.root() or Node(None, start)
        except _Refused:
            return None
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            syntax = Problem(self.place(mark) if mark else start, (), _syntax(error))
            self.problems.append((self.refusal_before(mark) if mark else None) or syntax)
            return None
        except (yaml.YAMLError, ValueError, OverflowError) as error:  # ValueError: an escape beyond Unicode
            self.problems.append(Problem(start, (), f"not YAML: {' '.join(str(error).split())}"))
            return None

    def root(self) -> Node | None:
        """The root node of the document; None if the text has no document."""
        events = yaml.parse(self.text, Loader=_LOADER)
        root = None
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    self.refuse(event.start_mark, "a second document; a scene file holds one")
                root = self.node(next(events), events, (), 1)
        return root

    def refusal_before(self, mark: Any) -> Problem | None:
        """The limit that the text exceeds before `mark`, where the parser stopped; None if it exceeds none.

        The parser scans ahead of its events, and newer versions have a depth limit of their own. So the text
        before the mark is read separately, and the limits here decide, whatever those of the parser are.
        """
        before = _Composer(self.text[: mark.index], self.place)
        try:
            before.root()
        except _Refused:
            return before.problems[-1]
        except (yaml.YAMLError, ValueError, OverflowError):
            pass
        return None

    def refuse(self, mark: Any, fact: str) -> None:
        self.problem(mark, (), fact)
        raise _Refused

    def problem(self, mark: Any, path: Path, fact: str) -> None:
        self.problems.append(Problem(self.place(mark), path, fact))

    def node(self, event: Any, events: Iterator[Any], path: Path, depth: int, key: Any = None) -> Node:
        """The node at `path` that `event` opens; `key` is the mark of its key."""
        # Aliases, and limits.
        mark = key or event.start_mark
        if isinstance(event, yaml.AliasEvent):
            aliased = self.alias(event, mark, path, depth)
            return aliased if key is None else replace(aliased, key=self.place(key))
        self.written += 1
        self.count(mark, 1)
        if depth > MAX_DEPTH:
            self.refuse(mark, f"nested deeper than {MAX_DEPTH} levels")

        # Anchors and tags.
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        if event.tag is not None and event.tag != "!":
            self.problem(mark, path, f"the tag {short(event.tag)} is not read; write the plain value")

        # The value.
        place = self.place(event.start_mark)
        of_key = None if key is None else self.place(key)
        if isinstance(event, yaml.ScalarEvent):
            node = Node(self.scalar(event, mark, path), place, of_key)
        elif isinstance(event, yaml.SequenceStartEvent):
            parts = self.sequence(events, path, depth)
            node = _branch(parts, parts, place, of_key)
        else:
            entries = self.mapping(events, path, depth)
            node = _branch(entries, entries.values(), place, of_key)
        if event.anchor is not None:
            self.anchors[event.anchor] = replace(node, key=None)
        return node

    def count(self, mark: Any, more: int) -> None:
        self.nodes += more
        if self.nodes > MAX_NODES:
            self.refuse(mark, f"more than {MAX_NODES} parts; keep large data in mesh files")

    def alias(self, event: Any, mark: Any, path: Path, depth: int) -> Node:
        name = short(event.anchor)
        node = self.anchors.get(event.anchor)
        self.aliases += 1
        if self.aliases > MAX_ALIASES:
            self.refuse(mark, f"more than {MAX_ALIASES} aliases")
        if node is None:
            fact = (
                "is inside its own anchor"
                if event.anchor in self.anchors
                else f"has no anchor &{name} before it"
            )
            self.problem(mark, path, f"the alias *{name} {fact}")
            return Node(f"*{name}", self.place(mark))
        if depth + node.depth > MAX_DEPTH:
            self.refuse(mark, f"nested deeper than {MAX_DEPTH} levels by aliases")
        self.count(mark, node.size)
        if self.nodes > MAX_GROWTH * (self.written + MAX_ALIASES):
            self.refuse(mark, f"the aliases expand to more than {MAX_GROWTH} times the text")
        return node

    def sequence(self, events: Iterator[Any], path: Path, depth: int) -> list[Node]:
        parts: list[Node] = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            parts.append(self.node(event, events, (*path, len(parts)), depth + 1))
        return parts

    def mapping(self, events: Iterator[Any], path: Path, depth: int) -> dict[str, Node]:
        entries: dict[str, Node] = {}
        merged: dict[str, Node] = {}
        while not isinstance(event := next(events), yaml.MappingEndEvent):
            mark = event.start_mark
            if not isinstance(event, yaml.ScalarEvent):
                self.refuse(mark, "a key must be text")
            key = event.value
            value = self.node(next(events), events, (*path, key), depth + 1, mark)
            if key == "<<" and event.implicit[0]:
                merged |= self.merged(value, path, mark)
            elif key in entries:
                first = entries[key].at
                where = f", first in line {first.line}" if first.line else ""
                self.problem(mark, path, f"the key '{short(key)}' stands twice{where}; remove one")
            else:
                entries[key] = value
        return merged | entries

    def merged(self, value: Node, path: Path, mark: Any) -> dict[str, Node]:
        """The entries that `<<:` merges: of one mapping, or of several, of which the first has priority."""
        entries: dict[str, Node] = {}
        for part in value.value if isinstance(value.value, list) else [value]:
            if isinstance(part.value, dict):
                entries = part.value | entries
            else:
                self.problem(mark, path, "<< must name mappings, as in `<<: *name`")
        return entries

    def scalar(self, event: Any, mark: Any, path: Path) -> Scalar:
        """The value of a scalar: quoted text as it is, plain text by YAML 1.2's core schema."""
        # Text, and a colour that YAML takes for a comment.
        text = event.value
        if not event.implicit[0] or event.style:
            return text
        if not text and (color := _UNQUOTED.match(self.text, event.end_mark.index)):
            self.problem(mark, path, f'{color[1]} is a comment here; write "{color[1]}" in quotes')
            return color[1]

        # null, true, false; numbers.
        if text in _WORDS:
            return _WORDS[text]
        if text[0] not in _NUMERIC:
            return text
        if _NOT_FINITE.fullmatch(text):
            self.problem(mark, path, f"must be a finite number, is {text}")
            return text
        integer = _INTEGER.fullmatch(text)
        if not integer and not _FLOAT.fullmatch(text):
            return text
        if len(text) > MAX_DIGITS:
            self.problem(mark, path, f"a number of {len(text)} digits; at most {MAX_DIGITS} count")
            return text
        if integer:
            base = {"0o": 8, "0x": 16}.get(text[:2], 10)
            return int(text, base)
        number = float(text)
        if not math.isfinite(number):
            self.problem(mark, path, f"must be a finite number, is {text}")
            return text
        return number


def _branch(
    value: list[Node] | dict[str, Node], parts: Iterable[Node], place: Place, key: Place | None
) -> Node:
    size, depth = 1, 0
    for part in parts:
        size += part.size
        depth = max(depth, part.depth)
    return Node(value, place, key, size, depth + 1)


def _syntax(error: yaml.MarkedYAMLError) -> str:
    message = " ".join(f"{error.problem or ''} {error.context or ''}".split())
    advice = next(
        (advice for part, advice in _ADVICE if part in message), "correct the text here or just above"
    )
    return f"not YAML: {short(message, 160)}; {advice}"
