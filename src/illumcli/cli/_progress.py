"""Progress with the time that remains, on stderr."""

from __future__ import annotations

import sys
import time

from illumcli.progress import Progress, no_progress


def reporter(quiet: bool) -> Progress:
    """A `Progress`: one line that is rewritten on a terminal, otherwise a plain line every ten seconds."""
    start, last, begun = time.monotonic(), time.monotonic(), ""
    terminal = sys.stderr.isatty()
    rewrite = getattr(sys.stderr, "write_raw", sys.stderr.write)

    def report(what: str, done: int, total: int) -> None:
        nonlocal start, last, begun
        now = time.monotonic()
        if done == 0 and begun != what:
            start, begun = now, what
        if done >= total:
            if terminal:
                rewrite("\r\x1b[K")
                sys.stderr.flush()
            start, begun = now, ""
            return
        if now - last < (0.1 if terminal else 10):
            return
        last = now
        left = (now - start) * (total - done) / max(done, 1)
        text = f"{what}: {100 * done / total:.0f} %" + (f", {clock(left)} left" if done else "")
        if terminal:
            rewrite("\r\x1b[K")
        print(text, end="" if terminal else "\n", file=sys.stderr, flush=True)

    return no_progress if quiet else report


def clock(seconds: float) -> str:
    """Minutes and seconds, or hours and minutes."""
    minutes, second = divmod(round(seconds), 60)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes}:{second:02d}"
