"""Reports of painted pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from illumcli.html_report.entries import Contents, Entry, Picture
from illumcli.images.writer import ImageWriter

HOSTILE = "<script>window.hacked=1</script><img src=x onerror=window.hacked=1>'\"&"


def write_picture(path: Path, pixels: np.ndarray) -> Path:
    """(H, W, 3) float32 linear light as an EXR, or uint8 display values as a PNG."""
    kind = "uint8" if path.suffix == ".png" else "half"
    height, width = pixels.shape[:2]
    with ImageWriter(path, width, height, dict.fromkeys("RGB", kind), {"illum:content": path.stem}) as writer:
        writer.write_band(0, pixels)
    return path


def painted(number: int) -> np.ndarray:
    """(9, 16, 3) uint8 a ramp that differs from number to number, of a colour of its own."""
    ramp = np.arange(16, dtype=np.uint8)[None, :, None] * 4 + np.arange(9, dtype=np.uint8)[:, None, None]
    color = np.array([(37 * number) % 190, (91 * number) % 190, (53 * number) % 190], np.uint8)
    return (ramp + color).astype(np.uint8)


def contents_of(folder: Path, entries: int = 60) -> Contents:
    """A grid of exponent x ambient x model, the last path fastest; variant 8 failed; a text is hostile."""
    exponents = [2, 8, 32, 128, 512]
    rows = [(e, a, m) for e in exponents for a in (0.1, 0.2, 0.3, 0.4) for m in ("phong", "ward", HOSTILE)]
    made = []
    for number, (exponent, ambient, model) in enumerate(rows[:entries]):
        failed = number == 7
        path = folder / "out" / f"{number}.png"
        if not failed:
            write_picture(path, painted(number))
        made.append(
            Entry(
                label=f"exponent {exponent}, ambient {ambient}, {model}",
                values={
                    "materials.glaze.exponent": str(exponent),
                    "ambient": str(ambient),
                    "materials.glaze.model": model,
                    "seed": "1",
                },
                content="incomplete" if failed else f"{number:032x}",
                state="failed" if failed else "rendered",
                command=f"illum render teapot.yaml -D ambient={ambient} -o out/{number}.png",
                error=f"no model {HOSTILE}" if failed else None,
                measures={} if failed else {"seconds": 0.5 + (number * 7) % 60, "rays": 1000.0 * number},
                pictures={} if failed else {"beauty": Picture(path, f"{number:032x}", 1.0)},
            )
        )
    return Contents(HOSTILE, tuple(made), 12.5, 9 / 16)
