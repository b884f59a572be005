"""Does coverage-guided fuzzing find a scene or mesh file that ends in anything but being loaded or refused?

atheris (libFuzzer for Python) keeps every case that reaches a branch of ours nothing reached before, and
changes it further. It starts from the scenes of this repository and from small sound meshes. Every kind of
failure is printed once, with its case, and the run goes on; a case of more than 10 s or 2 GiB, or a crash of
the interpreter, ends it. Needs `pip install atheris`; `fuzz.py` changes bytes blindly and needs nothing.

    python benchmarks/fuzz_atheris.py scene|obj|ply|stl|gltf|glb|mtl [SECONDS] [FOLDER]

FOLDER keeps what was found worth keeping, from run to run. Nightly: half an hour of each.
"""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["illumcli.scene", "illumcli.mesh_files"]):
    import fuzz
    from illumcli.errors import IllumError
    from illumcli.mesh_files import (
        read_mesh,
    )
    from illumcli.scene.load import load

TARGETS = ("scene", "obj", "ply", "stl", "gltf", "glb", "mtl")
MESH_OF_LIBRARY = b"mtllib case.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def main() -> None:
    """Fuzz one target."""
    target = sys.argv[1] if len(sys.argv) > 1 else ""
    if target not in TARGETS:
        sys.exit(__doc__)
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 180
    corpus = Path(sys.argv[3] if len(sys.argv) > 3 else tempfile.mkdtemp(prefix=f"fuzz-{target}-"))
    corpus.mkdir(parents=True, exist_ok=True)
    for number, case in enumerate(seeds(target)):
        (corpus / f"seed{number}").write_bytes(case)
    folder = Path(tempfile.mkdtemp(dir="/dev/shm" if os.path.isdir("/dev/shm") else None))
    path = folder / f"case.{'yaml' if target == 'scene' else target}"
    mesh = folder / "mesh.obj"
    mesh.write_bytes(MESH_OF_LIBRARY)
    known: set[tuple[str, ...]] = set()

    def one(data: bytes) -> None:
        path.write_bytes(data)
        try:
            if target == "scene":
                load(path)
            else:
                read_mesh(mesh if target == "mtl" else path)
        except IllumError:
            pass
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            kind = (type(error).__name__, last.filename, str(last.lineno))
            if kind not in known:
                known.add(kind)
                print(f"FOUND {kind}: {error!s:.200}\n  {data[:2000]!r}", file=sys.stderr, flush=True)

    options = [f"-max_total_time={seconds}", "-max_len=4096", "-timeout=10", "-rss_limit_mb=2048"]
    atheris.Setup([sys.argv[0], *options, "-print_final_stats=1", "-verbosity=0", str(corpus)], one)
    atheris.Fuzz()


def seeds(target: str) -> list[bytes]:
    """Sound files to begin with."""
    if target == "scene":
        return [path.read_bytes() for path in sorted((fuzz.ROOT / "scenes").glob("*.yaml"))]
    if target == "mtl":
        return [
            b"newmtl a\nKa 0 0 0\nKd 1 .5 0\nKs 1 1 1\nNs 9\nillum 2\nd 1\nmap_Kd -mm 0 1 -clamp on w.png\n"
        ]
    return [data for suffix, data in fuzz.meshes().values() if suffix == f".{target}"]


if __name__ == "__main__":
    main()
