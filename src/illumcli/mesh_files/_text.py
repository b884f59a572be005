"""Text files of numbers, parsed in bulk: a few numpy passes over all bytes instead of a loop over lines."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import field
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.repairs import Repair, note
from illumcli.mesh_files._polygons import Ints
from illumcli.mesh_files._words import decoded
from illumcli.records import Value

PIECE = 1 << 22  # bytes cut into words at a time: Python's words need ten times the memory of their text
PADDING = 8  # bytes that may be read behind the start of the last line
NEWLINE = b"\n"

BYTE_ORDER_MARK = codecs.BOM_UTF8

_LONE_RETURN = re.compile(rb"\r(?!\n)")
_CONTINUED = re.compile(rb"\\[ \t]*\r?\n")
_NOT_FINITE = re.compile(rb"[-+]?(?:\d+\.#[A-Z]+\d*|nan\(\w*\))", re.IGNORECASE)  # as Microsoft's C writes it
_COMMENT = re.compile(rb"(?<!\S)#[^\n]*")
_COMMENT_BEHIND_NUMBER = re.compile(rb"^([ \t]*(?:v[tn]?|f)[ \t][^#\n]*)#[^\n]*", re.M | re.I)
_BLANKS = re.compile(rb"[ \t\r\v\f]*")


class Text(Value):
    """The lines of a file that are not empty, without comments and with continued lines joined.

    Removed text is replaced by equally many blanks, so offsets in `data` are offsets in `raw`.
    """

    path: Path
    raw: bytes  # as in the file, lines ended by \n
    data: bytes
    repairs: dict[str, Repair] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path, raw: bytes, *, comments: bool = False, continued: bool = False) -> Text:
        """The text `raw`; comments begin with #, a backslash at its end continues a line."""
        repairs: dict[str, Repair] = {}
        if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            note(repairs, "texts in UTF-16", ":1")
            raw = raw.decode("utf-16", "replace").encode()
        if raw.startswith(BYTE_ORDER_MARK):
            note(repairs, "byte order marks left out", ":1")
            raw = b"   " + raw[3:]
        if b"\r" in raw and _LONE_RETURN.search(raw):
            raw = _LONE_RETURN.sub(b"\n", raw)
        text = raw.rstrip(b"\0\x1a")
        if len(text) < len(raw):
            first = f":{1 + text.count(NEWLINE)}"
            note(repairs, "NUL and Ctrl-Z behind the text left out", first, len(raw) - len(text))
        data = text + b"\n" * PADDING
        if b".#" in data or b"nan(" in data:
            data = _NOT_FINITE.sub(lambda match: b"nan".ljust(len(match[0])), data)
        if comments and b"#" in data:
            data = _COMMENT.sub(lambda match: NEWLINE * len(match[0]), data)
            data = _without_comments_behind_numbers(data, raw, repairs)
        if continued and b"\\" in data:
            data = _CONTINUED.sub(lambda match: b" " * len(match[0]), data)
        return cls(path, raw, data, repairs)

    @cached_property
    def bytes(self) -> NDArray[np.uint8]:
        return np.frombuffer(self.data, np.uint8)

    @cached_property
    def starts(self) -> Ints:
        """(L,) offset of the first letter of each line that has one, ascending."""
        ends = np.flatnonzero(self.bytes[:-PADDING] == 10)
        starts = np.concatenate(([0], ends + 1))
        first = self.bytes[starts]
        for i in np.flatnonzero((first <= 32) & (first != 10)):
            match = _BLANKS.match(self.data, starts[i])
            starts[i] = match.end() if match else starts[i]
        return starts[self.bytes[starts] != 10]

    def keywords(self, width: int) -> NDArray[np.uint64]:
        """(L,) the first word of each line, at most `width` letters in lower case, coded as by `keyword`."""
        code = np.zeros(len(self.starts), np.uint64)
        inside = np.ones(len(self.starts), bool)
        for i in range(width):
            letter = self.bytes[self.starts + i]
            letter[(letter >= 65) & (letter <= 90)] += 32
            inside &= letter > 32
            code |= np.where(inside, letter, 0).astype(np.uint64) << np.uint64(8 * i)
        return code

    def line(self, index: int) -> str:
        """The content of a line, without surrounding blanks."""
        start = self.starts[index]
        return decoded(self.data[start : self.data.index(b"\n", start)]).strip()

    def number(self, index: int) -> int:
        """Number of a line in the file, from 1."""
        return 1 + self.raw.count(NEWLINE, 0, self.starts[index])

    def place(self, index: int) -> str:
        """``path:line`` of a line."""
        return f"{self.path}:{self.number(index)}"

    def block(self, lines: NDArray[np.intp], keyword: int = 0) -> Block:
        """The lines of these ascending indices; the first `keyword` letters of each become blanks."""
        if not len(lines):
            return Block(self, lines, np.empty(0, np.uint8), np.empty(0, np.int64))
        ends = np.append(self.starts[1:], len(self.data))
        breaks = np.flatnonzero(np.diff(lines) != 1) + 1
        first, last = lines[np.append(0, breaks)], lines[np.append(breaks - 1, len(lines) - 1)]
        pieces = zip(self.starts[first].tolist(), ends[last].tolist(), strict=True)
        data = np.frombuffer(bytearray().join([self.data[start:end] for start, end in pieces]), np.uint8)
        lengths = ends[lines] - self.starts[lines]
        starts = np.cumsum(lengths) - lengths
        for i in range(keyword):
            data[starts + i] = 32
        return Block(self, lines, data, starts)


def keyword(word: bytes) -> int:
    """The code of a word of at most eight letters in `Text.keywords`."""
    return int.from_bytes(word, "little")


class Block(Value):
    """Some lines of a text, one after the other."""

    text: Text
    lines: NDArray[np.intp]  # (B,) their indices in `text`
    data: NDArray[np.uint8]
    starts: Ints  # (B,) offset of each in `data`

    @cached_property
    def heads(self) -> NDArray[np.bool_]:
        """(len(data),) True at the first letter of each word."""
        letters = self.data > 32
        letters[1:] &= ~letters[:-1]
        return letters

    @cached_property
    def counts(self) -> Ints:
        """(B,) words of each line."""
        if not len(self.starts):
            return np.empty(0, np.int64)
        return np.add.reduceat(self.heads, self.starts, dtype=np.int32).astype(np.int64)

    def floats(self, needed: int | None = None) -> NDArray[np.float64]:
        """All words as numbers in full precision, line after line.

        Words that are not numbers are refused, or only if they are among the first `needed` of a line; the
        others become NaN.
        """
        words = chain.from_iterable(map(bytes.split, self._pieces()))
        try:
            if np.any(self.data == ord("_")):  # `float` would skip it
                raise ValueError
            return np.fromiter(map(float, words), np.float64)
        except ValueError:
            return self._floats_among_words(needed)

    def _floats_among_words(self, needed: int | None) -> NDArray[np.float64]:
        """`floats` for lines that have other words, too."""
        edges = pairwise([*self.starts.tolist(), len(self.data)])
        values = []
        for line, (start, end) in enumerate(edges):
            words = self.data[start:end].tobytes().split()
            for column, word in enumerate(words):
                number = _is_number(word, float)
                # control characters separate words here, but not in `counts`
                if not number and (needed is None or column < needed or len(words) != self.counts[line]):
                    raise self._bad_word(line, word, "number")
                values.append(float(word) if number else np.nan)
        return np.array(values, np.float64)

    def integers(self) -> Ints:
        """All words as integers, line after line; those too large for int64 become its largest."""
        total = int(self.counts.sum())
        try:  # older numpy only warns and stops at a bad word: then the appended 0 is missing
            return np.fromstring(self.data.tobytes() + b" 0", np.int64, sep=" ")[:-1].reshape(total)
        except (ValueError, DeprecationWarning):
            raise self._bad_integer() from None

    def place(self, index: int) -> str:
        """``path:line`` of one of the lines."""
        return self.text.place(int(self.lines[index]))

    def _pieces(self) -> Iterator[bytes]:
        """The data, cut between lines every `PIECE` bytes."""
        cuts = set(np.searchsorted(self.starts, np.arange(0, len(self.data), PIECE)).tolist())
        edges = [*self.starts[sorted(cuts - {len(self.starts)})].tolist(), len(self.data)]
        for start, end in pairwise(edges):
            yield self.data[start:end].tobytes()

    def _bad_integer(self) -> InputError:
        """The error for the first word that is not a whole number."""
        edges = pairwise([*self.starts.tolist(), len(self.data)])
        lines = (self.data[start:end].tobytes().split() for start, end in edges)
        i, bad = next(
            (i, word) for i, words in enumerate(lines) for word in words if not _is_number(word, int)
        )
        return self._bad_word(i, bad, "whole number")

    def refuse_words(self, line: int, needed: int) -> None:
        """Refuse a line that has fewer than `needed` numbers; the message names its first other word."""
        edges = [*self.starts.tolist(), len(self.data)]
        words = self.data[edges[line] : edges[line + 1]].tobytes().split()[:needed]
        for word in words:
            if not _is_number(word, float):
                raise self._bad_word(line, word, "number")
        if len(words) < needed:
            fact = f"has {len(words)} numbers, not {needed}"
            raise InputError(f"{self.place(line)}: {fact}; export the mesh again")

    def _bad_word(self, line: int, word: bytes, kind: str) -> InputError:
        advice = "write a decimal point, not a comma" if b"," in word else "export the mesh again"
        return InputError(f"{self.place(line)}: '{decoded(word):.40}' is no {kind}; {advice}")


def _without_comments_behind_numbers(data: bytes, raw: bytes, repairs: dict[str, Repair]) -> bytes:
    """`data` without comments that begin within a word, in lines of numbers; a name may hold a #."""
    if b"#" not in data:
        return data

    def blank(match: re.Match[bytes]) -> bytes:
        lines = "" if what in repairs else f":{1 + raw.count(NEWLINE, 0, match.start())}"
        note(repairs, what, lines)
        return match[1] + NEWLINE * (match.end() - match.end(1))

    what = "comments that follow a number without a blank"
    return _COMMENT_BEHIND_NUMBER.sub(blank, data)


def _is_number(word: bytes, kind: type[int] | type[float]) -> bool:
    try:
        kind(word)
    except ValueError:
        return False
    return b"_" not in word
