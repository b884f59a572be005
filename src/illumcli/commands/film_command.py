"""The command that makes a film of the images of an animation."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from pathlib import Path


def film_command(frames: Sequence[tuple[int, Path]], fps: float) -> str | None:
    """The ffmpeg command for the images of a film; None unless frames follow each other and are PNG.

    Versions of ffmpeg treat the linear light of EXR files differently.

    Parameters
    ----------
    frames : sequence of (int, Path)
        Number and file of frames, of which the first two are enough.
    fps : float
        Frames per second.

    References
    ----------
    FFmpeg Formats Documentation, "image2"; FFmpeg Filters Documentation, "pad". https://ffmpeg.org
    """
    # Find the number in the name of the first file.
    if len(frames) < 2:
        return None
    (first, path), (second, next_path) = frames[:2]
    if second != first + 1 or path.suffix.lower() != ".png":
        return None
    name, other = str(path), str(next_path)
    for digits in re.finditer(r"\d+", name):
        width = len(digits[0])
        before, after = name[: digits.start()], name[digits.end() :]
        if int(digits[0]) == first and f"{before}{second:0{width}d}{after}" == other:
            break
    else:
        return None

    # H.264 has an even number of rows and columns.
    images = f"{before.replace('%', '%%')}%0{width}d{after.replace('%', '%%')}"
    film = (before.rstrip("._-") or "film") + after.rpartition(".")[0] + ".mp4"
    start = ["-start_number", str(first)] if first else []
    even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]
    return shlex.join(["ffmpeg", "-framerate", f"{fps:.6g}", *start, "-i", images, *even, film])
