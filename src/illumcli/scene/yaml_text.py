"""Plain values as YAML, which `source` reads as the same values."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

WIDTH = 110
"""Mappings that fit into a line of this length may stand on one."""

_PLAIN = re.compile(r"[A-Za-z_][\w./-]*")
_KEY = re.compile(r"[\w.-]+")
_WORDS = ("true", "false", "null")


def flow(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_key(name)}: {flow(part)}' for name, part in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(flow, value))}]"
    if isinstance(value, str):
        is_plain = _PLAIN.fullmatch(value) and value.lower() not in _WORDS
        return value if is_plain else _quoted(value)
    return json.dumps(value)


def block(mapping: Mapping[str, Any], indent: str = "") -> str:
    """A mapping with a line for each key, and more lines for values in which mappings stand."""
    lines = []
    for name, value in mapping.items():
        key = f"{indent}{_key(name)}:"
        line = f"{key} {flow(value)}\n"
        if isinstance(value, list) and any(isinstance(part, Mapping) for part in value):
            lines.append("".join([f"{key}\n", *(f"{indent}  - {flow(part)}\n" for part in value)]))
        elif isinstance(value, Mapping) and value and not (_is_flat(value) and len(line) <= WIDTH):
            lines.append(f"{key}\n{block(value, f'{indent}  ')}")
        else:
            lines.append(line)
    return "".join(lines)


def _is_flat(mapping: Mapping[str, Any]) -> bool:
    return not any(isinstance(part, Mapping) for part in mapping.values())


def _key(name: str) -> str:
    return name if _KEY.fullmatch(name) else _quoted(name)


def _quoted(text: str) -> str:
    """Text in double quotes, in which YAML reads JSON's escapes."""
    quoted = json.dumps(text, ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in quoted)
