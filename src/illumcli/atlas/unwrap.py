"""uv for meshes that have none, by xatlas (the extra `unwrap`).

References
----------
Young, J. xatlas. https://github.com/jpcy/xatlas
"""

from __future__ import annotations

import io
import subprocess
import sys
import time
from importlib.metadata import version
from importlib.util import find_spec
from tempfile import TemporaryFile

import numpy as np
from numpy.typing import NDArray

from illumcli.atlas.triangles import TextureSize
from illumcli.errors import IllumError, InputError
from illumcli.progress import Progress
from illumcli.records import Record

EXTENT = 100.0
"""Meshes are scaled to this size: at the size of their files, charts of small ones have no area."""
GUTTER = 256
"""Charts are one texel in so many of the texture's side apart, but at least `MIN_GUTTER`."""
MIN_GUTTER = 2
SECONDS = 2e-6
"""Expected time of a mesh of T triangles [s per T^1.4]: 12 s for 70,000, 80 s for 270,000."""
POLL = 0.05
"""[s]"""
_COMMAND = ("-m", "illumcli.atlas.xatlas_process")


class Unwrapped(Record):
    """New uv of T triangles, without overlaps."""

    uvs: NDArray[np.float32]  # (U, 2) v upwards
    corner_uvs: NDArray[np.int32]  # (T, 3)


def refuse_missing_library() -> None:
    """Raise InputError if xatlas is not installed."""
    if find_spec("xatlas") is None:
        raise InputError("--unwrap needs xatlas; install it with: pip install 'illumcli[unwrap]'")


def library() -> str:
    """Name and version of what makes uv: equal ones make equal uv."""
    return f"xatlas {version('xatlas')}"


def unwrapped(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], size: TextureSize, progress: Progress
) -> Unwrapped:
    """uv of triangles for a texture of this size; takes seconds to minutes.

    Parameters
    ----------
    vertices : (V, 3)
    triangles : (T, 3)
    progress
        Told of seconds, and of those that are expected.

    Raises
    ------
    IllumError
        The library ended without uv.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    extent = float((high - low).max()) or 1.0
    resolution = max(size.width, size.height)
    data = io.BytesIO()
    np.savez(
        data,
        vertices=((vertices - low) * (EXTENT / extent)).astype(np.float32),
        triangles=triangles.astype(np.uint32),
        resolution=resolution,
        padding=max(resolution // GUTTER, MIN_GUTTER),
    )
    result = _run(data.getvalue(), SECONDS * len(triangles) ** 1.4, progress)
    with np.load(io.BytesIO(result)) as arrays:
        return Unwrapped(arrays["uvs"].astype(np.float32), arrays["corner_uvs"].astype(np.int32))


def _run(data: bytes, expected: float, progress: Progress) -> bytes:
    """What the process writes."""
    start = time.monotonic()
    with TemporaryFile() as given, TemporaryFile() as result, TemporaryFile() as errors:
        given.write(data)
        given.seek(0)
        with subprocess.Popen(
            [sys.executable, *_COMMAND], stdin=given, stdout=result, stderr=errors
        ) as process:
            try:
                while process.poll() is None:
                    time.sleep(POLL)
                    seconds = time.monotonic() - start
                    progress("unwrap", round(10 * seconds), round(10 * max(expected, 1.1 * seconds)))
            finally:
                process.kill()
        if process.returncode:
            errors.seek(0)
            lines = errors.read().decode(errors="replace").strip().splitlines()
            fact = f"xatlas ended with {process.returncode}: {lines[-1] if lines else 'no reason given'}"
            raise IllumError(f"{fact}; unwrap the mesh in another program")
        result.seek(0)
        return result.read()
