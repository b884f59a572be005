"""Does any scene or mesh file end in anything but being loaded or refused?

Bytes of the scenes of this repository and of small meshes are changed at random, and scenes are drawn from
the schema. Every case runs in this process: a crash of the interpreter ends the script by a signal, which is
the finding. Printed are the counts of what came of them, and every case that was neither loaded nor refused.

    python benchmarks/fuzz.py [COUNT] [SEED]       # 2,000 of each kind take a minute; nightly 100,000
"""

from __future__ import annotations

import importlib.util
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[1]
SLOW = 2.0  # [s]
TOKENS = (
    b"nan", b".inf", b"1e400", b"-1", b"[", b"]", b"{", b"}", b"&a ", b"*a", b"<<: ", b"null",
    b"!!python/object ", b"\x00", b"\xff", b"  ", b"\n", b"- ", b": ", b"0x",
    b"99999999999999999999", b"'", b'"', b"extends: ", b"1e-400",
)  # fmt: skip


def mutated(data: bytes, draw: random.Random) -> bytes:
    """`data` with one to four changes: bytes set, cut, repeated, tokens put in; now and then cut short."""
    out = bytearray(data)
    for _ in range(draw.randint(1, 4)):
        at = draw.randrange(len(out) + 1)
        match draw.randrange(20) // 4:
            case 0 if at < len(out):
                out[at] = draw.randrange(256)
            case 1:
                del out[at : at + draw.randint(1, 40)]
            case 2:
                out[at:at] = out[at : at + draw.randint(1, 200)]
            case 3:
                out[at:at] = draw.choice(TOKENS)
            case 4 if at < len(out):
                out[at] ^= 1 << draw.randrange(8)
            case _ if draw.random() < 0.1:
                del out[draw.randrange(max(1, len(out))) :]
        if not out:
            break
    return bytes(out)


def scene_cases(count: int, draw: random.Random) -> Iterator[bytes]:
    """Changed scene files."""
    scenes = [path.read_bytes() for path in sorted((ROOT / "scenes").glob("*.yaml"))]
    for _ in range(count):
        yield mutated(draw.choice(scenes), draw)


def schema_cases(count: int, seed: int) -> list[str]:
    """Scenes drawn from the JSON schema, most of them wrong in some part."""
    import json

    from illumcli.commands.schema import schema_text

    schema, draw = json.loads(schema_text()), random.Random(seed)
    return [json.dumps(_drawn(schema, schema.get("$defs", {}), draw, 0)) for _ in range(count)]


def _drawn(part: dict, defs: dict, draw: random.Random, depth: int) -> object:
    odd = (None, True, "text", -1, 0, 1e18, 1e19, -1e-300, [], {}, [1, 2], {"a": 1}, "1e3", 2**70)
    if draw.random() < 0.03 or depth > 12:
        return draw.choice(odd)
    if "$ref" in part:
        return _drawn(defs[part["$ref"].rpartition("/")[2]], defs, draw, depth + 1)
    for several in ("anyOf", "oneOf", "allOf"):
        if several in part:
            return _drawn(draw.choice(part[several]), defs, draw, depth + 1)
    if "const" in part:
        return part["const"]
    if "enum" in part:
        return draw.choice(part["enum"])
    match part.get("type"):
        case "object":
            needed = set(part.get("required", ()))
            chosen = {
                name: _drawn(inner, defs, draw, depth + 1)
                for name, inner in part.get("properties", {}).items()
                if name in needed or draw.random() < 0.35
            }
            if "additionalProperties" in part and isinstance(part["additionalProperties"], dict):
                for _ in range(draw.randint(0, 2)):
                    name = draw.choice(("a", "b_1", "c-d", "1x", ""))
                    chosen[name] = _drawn(part["additionalProperties"], defs, draw, depth + 1)
            return chosen
        case "array":
            if "prefixItems" in part:
                return [_drawn(each, defs, draw, depth + 1) for each in part["prefixItems"]]
            return [_drawn(part.get("items", {}), defs, draw, depth + 1) for _ in range(draw.randint(0, 3))]
        case "integer":
            low, high = part.get("minimum", 0), part.get("maximum", 2**31)
            return draw.choice((low, high, low + 1, min(high, 7), low - 1, high + 1))
        case "number":
            low = part.get("minimum", part.get("exclusiveMinimum", -10))
            high = part.get("maximum", part.get("exclusiveMaximum", 1e18))
            return draw.choice((low, high, draw.uniform(low, min(high, low + 10)), 0.5))
        case "boolean":
            return draw.random() < 0.5
        case "string":
            return draw.choice(("a", "box.obj", "../x", "", "{scene}.png", "0.5r", "\u0130"))
    return draw.choice(odd)


def tried(cases: Iterator[bytes] | list[bytes], suffix: str, read: Callable[[Path], object]) -> Counter[str]:
    """What came of every case; what is neither loaded nor refused is printed with the case."""
    from illumcli.errors import IllumError

    found: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"case{suffix}"
        for case in cases:
            path.write_bytes(case)
            start = time.monotonic()
            try:
                read(path)
                what = "loaded"
            except IllumError as error:
                what = f"refused, exit {error.exit_code}"
            except Exception as error:
                what = f"{type(error).__name__}: {str(error)[:80]}"
                print(f"{what}\n  {case[:2000]!r}", file=sys.stderr)
            if time.monotonic() - start > SLOW:
                what = "slow"
                print(f"slow\n  {case[:2000]!r}", file=sys.stderr)
            found[what] += 1
    return found


def load_and_plan(path: Path) -> None:
    """A scene as `illum plan` reads it."""
    from illumcli.commands.options import RenderJob
    from illumcli.commands.work import prepared

    prepared(RenderJob(path))


def meshes() -> dict[str, tuple[str, bytes]]:
    """Name -> suffix and content of a small sound mesh, of every format."""
    return dict(_mutations().SOUND)


def _mutations() -> ModuleType:
    path = ROOT / "tests" / "geometry" / "readers" / "test_mutated_meshes.py"
    spec = importlib.util.spec_from_file_location("mutated_meshes", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def main() -> None:
    """Fuzz scenes, then each mesh format."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    draw = random.Random(seed)
    from illumcli.mesh_files import read_mesh

    os.environ.setdefault("ILLUM_CACHE", "")
    rows = {"scene bytes": tried(scene_cases(count, draw), ".yaml", load_and_plan)}
    drawn = [text.encode() for text in schema_cases(count, seed)]
    rows["scenes of the schema"] = tried(drawn, ".yaml", load_and_plan)
    for name, (suffix, data) in meshes().items():
        cases = (mutated(data, draw) for _ in range(count))
        rows[name] = tried(cases, suffix, read_mesh)
    print(f"{'cases':24}{'loaded':>8}{'refused':>9}{'other':>7}")
    for name, found in rows.items():
        refused = sum(number for what, number in found.items() if what.startswith("refused"))
        other = found.total() - found["loaded"] - refused
        print(f"{name:24}{found['loaded']:8d}{refused:9d}{other:7d}")


if __name__ == "__main__":
    main()
