"""Progress with the time that remains, on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable


def reporter(quiet: bool) -> Callable[[str, int, int], None]:
    """What jobs call with (what, done, of): a line that rewrites itself on a terminal, else a plain line
    every ten seconds."""
    start, last = time.monotonic(), time.monotonic()
    terminal = sys.stderr.isatty()
    rewrite = getattr(sys.stderr, "obeyed", sys.stderr.write)

    def report(what: str, done: int, of: int) -> None:
        nonlocal start, last
        now = time.monotonic()
        if done >= of:
            if terminal:
                rewrite("\r\x1b[K")
                sys.stderr.flush()
            start = now
            return
        if now - last < (0.1 if terminal else 10):
            return
        last = now
        left = (now - start) * (of - done) / max(done, 1)
        text = f"{what}: {100 * done / of:.0f} %, {clock(left)} left"
        if terminal:
            rewrite("\r\x1b[K")
        print(text, end="" if terminal else "\n", file=sys.stderr, flush=True)

    return (lambda what, done, of: None) if quiet else report


def clock(seconds: float) -> str:
    """Minutes and seconds, or hours and minutes."""
    minutes, second = divmod(round(seconds), 60)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes}:{second:02d}"
