"""One window: its messages, what it shows, and the pictures that follow."""

from __future__ import annotations

import json
import reprlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from threading import Condition
from typing import Any

from illumcli.errors import known
from illumcli.layers import FIXED
from illumcli.rays.viewpoints import Camera
from illumcli.viewer.answers import Stated, picture_answer, pixel_answer, scene_answer
from illumcli.viewer.changes import changed, reread
from illumcli.viewer.controls import controls
from illumcli.viewer.lobes import LobePanel
from illumcli.viewer.messages import MISUNDERSTOOD, Message, coalesced, message_of
from illumcli.viewer.pace import Pace
from illumcli.viewer.pictures import Picture, Renderer
from illumcli.viewer.quality import FEW_RAYS, FEWEST_RAYS, Coarse, Quality, reconstructed, stage
from illumcli.viewer.watching import PERIOD
from illumcli.viewer.window import Window

Send = Callable[[str | bytes], None]
"""Sends a message to the page."""
LINGER = 0.15
"""Seconds without a message after which a drag counts as resting, so that pictures become finer."""
TRACED, SHADED = 0.12, 0.04
"""Seconds for a coarse picture whose rays are cast anew, and for one that casts few or none."""
LONG = 1.0
"""Seconds of obscurance rays from which on a picture of fewer, reconstructed, comes before the full one."""
GEOMETRY = {"hits", "obscurance", "raw_obscurance"}
"""Buffers whose rays are many; those of a light that moves are few."""
MOST = 256
"""Messages that wait, at most; a page that sends more has to wait itself."""
QUESTIONS = ("pick", "lobes", "save", "command")
"""Messages that do not change what is shown."""


class Superseded(Exception):
    """A newer message makes a picture in progress useless."""


class Session:
    """What one window shows. One thread gives it messages; another one, in `run`, does everything else.

    A message that changes the picture ends whatever is being rendered, at its next batch of rays. Then come a
    coarse picture, at once, and finer ones up to the full picture. Coarse pictures are as large as the times
    of the last ones allow; whether a change casts many rays is known from its last time. Where the obscurance
    rays of the full picture take long, by the speed of those cast last, a whole picture with reconstructed
    obscurance comes before it, and states its error.

    Parameters
    ----------
    renderer : Renderer
        Of the scene; this session's own.
    send : callable
        Sends a text or bytes to the page.
    """

    def __init__(self, renderer: Renderer, send: Send) -> None:
        self._renderer = renderer
        self._send = send
        self._news = Condition()
        self._pending: list[Message] = []
        self._is_closed = False

        # What is shown, as of how many changes, and up to which of them the pictures are complete.
        self._window: Window | None = None
        self._version, self._complete = 0, 0
        self._picture: Picture | None = None
        self._stated: Stated | None = None
        self._stamp: float | None = None
        self._is_dragging = False
        self._faulty: int | None = None
        """The change whose problem the page shows."""
        self._is_unread = False
        """True if the file of the scene is faulty."""
        self._version_read = 0
        """The change that was made last by files."""

        # What the page knows of the controls, and what the pictures of changes cost.
        self._told: dict[str, Any] = {}
        self._causes: set[str] = set()
        self._traced = {"move"}
        self._moving, self._resting = Pace(TRACED, 1 << 16), Pace(SHADED, 1 << 18)
        self._is_warm = False
        self._coarse: Coarse | None = None
        self._ray_seconds = 0.0
        """What an obscurance ray took last."""
        self._lobes = LobePanel()

    def receive(self, text: str | bytes) -> None:
        """Take a message of the page; wait first while `MOST` are not read."""
        message = message_of(text)
        with self._news:
            self._news.wait_for(lambda: len(self._pending) < MOST or self._is_closed)
            self._pending.append(message)
            self._news.notify_all()

    def close(self) -> None:
        """End `run`."""
        with self._news:
            self._is_closed = True
            self._news.notify_all()

    def run(self) -> None:
        """Answer messages and render until the session is closed."""
        self._read()
        while not self._is_closed:
            try:
                self._refine()
            except Superseded:
                continue
            except Exception as error:
                is_edited = self._window is not None and bool(self._window.edits)
                is_new = self._version == self._version_read
                self._tell_problem(_problem(error), "edit" if is_edited and not is_new else "file")
            self._complete = self._version
            while self._complete == self._version and not self._is_closed:
                self._wait(PERIOD)
                self._listen()

    # --- pictures -------------------------------------------------------------------------------------------

    def _refine(self) -> None:
        """Show pictures of the window, from coarse to full."""
        window, version = self._window, self._version

        def go_on(*progress: object) -> None:
            self._listen()
            if self._version != version or self._is_closed:
                raise Superseded

        if window is None:
            return
        for quality in self._stages(window):
            self._show(window, quality, go_on)
            if self._is_dragging:
                self._wait(LINGER)
            go_on()

    def _stages(self, window: Window) -> Iterator[Quality]:
        """The qualities of the pictures that follow a change."""
        if window.layer in FIXED and FIXED[window.layer].per_pixel:  # it is made of complete pictures
            yield None
            return
        pixels = window.film[0] * window.film[1]
        obscurance = window.now.scene.obscurance
        rays = 1 if obscurance is None else obscurance.samples
        moving = Coarse(self._moving.divisor(pixels), min(FEWEST_RAYS, rays))
        resting = Coarse(self._resting.divisor(pixels), min(FEW_RAYS, rays))
        yield moving if self._coarse is None or self._causes & self._traced else self._coarse
        if self._coarse != resting:
            yield resting
        middle = reconstructed(window.scene, window.camera)
        if middle and self._renderer.obscurance_rays(window) * self._ray_seconds > LONG:
            yield middle
        yield None

    def _show(self, window: Window, quality: Quality, go_on: Callable[..., None]) -> None:
        """Render a picture, send it, and note its time."""
        start = time.perf_counter()
        picture = self._picture = self._renderer.picture(window, quality, go_on)
        if quality is None:
            self._complete = self._version
        if picture.error is not None:
            self._stated = Stated(self._version, stage(quality), window.layer, picture.error)
        self._send(picture_answer(picture, self._stamp, self._version, self._stated))
        if self._faulty is not None and self._faulty < self._version and not self._is_unread:
            self._faulty = None
            self._tell({"type": "solved"})
        self._ray_seconds = picture.ray_seconds or self._ray_seconds
        if not isinstance(quality, Coarse):
            return
        is_traced = bool(GEOMETRY & picture.report.rays.keys())
        self._traced = self._traced | self._causes if is_traced else self._traced - self._causes | {"move"}
        if self._is_warm:  # nothing was read from files
            pace = self._moving if is_traced else self._resting
            pace.add(quality.divisor, time.perf_counter() - start)
        self._causes, self._coarse, self._is_warm = set(), quality, True

    # --- messages -------------------------------------------------------------------------------------------

    def _wait(self, seconds: float) -> None:
        """Wait for a message."""
        with self._news:
            self._news.wait_for(lambda: self._pending or self._is_closed, timeout=seconds)

    def _listen(self) -> None:
        """Apply the messages that came, and changes of files; what is faulty changes nothing."""
        if self._renderer.is_outdated:
            self._read()
        with self._news:
            messages, self._pending = self._pending, []
            self._news.notify_all()
        if not messages or self._window is None:
            return
        before, is_told, is_change = self._version, True, False
        for message in coalesced(messages):
            is_change |= message.get("type") not in QUESTIONS
            try:
                is_told = self._apply(message) and is_told
            except Exception as error:
                origin = "save" if message.get("type") == "save" else "edit"
                self._tell_problem(_refusal(message, error), origin)
                is_told = False
        if not is_told:
            self._tell_controls(self._window)
        if is_change and before == self._version == self._complete:
            self._tell({"type": "same", "stamp": self._stamp})

    def _apply(self, message: Message) -> bool:
        """Do what a message says. Returns False if the page has to be told what its controls show now."""
        assert self._window is not None
        kind = message["type"]
        if kind in QUESTIONS:
            if answer := self._answer(self._window, message):
                self._tell({**answer, **_stamp(message)})
            return True

        # A change: the page knows already what it sets.
        if (stamp := message.get("stamp")) is not None:
            self._stamp = max(self._stamp or 0.0, float(stamp))
        self._is_dragging = bool(message.get("dragging"))
        if kind == "set" and message["path"] in self._told:
            self._told[message["path"]] = message["value"]
        if kind in ("reset", "restore"):
            self._told.clear()
        window = changed(self._window, message, self._renderer.loaded, self._camera())
        if window.choices != self._window.choices:
            self._version += 1
            self._causes.add(str(message.get("path", kind)))
        self._window = window
        return kind == "view" or self._is_dragging

    def _answer(self, window: Window, message: Message) -> dict[str, Any] | None:
        """The answer to a question; None if there is none yet."""
        match message["type"]:
            case "pick":
                picture = self._picture
                return None if picture is None else pixel_answer(picture, message["x"], message["y"])
            case "lobes":
                return self._lobes.answer(window.now, message)
            case "save":
                self._renderer.save(Path(message["file"]), window, bool(message.get("replace")))
                return {"type": "saved", "file": message["file"]}
            case _:
                return {"type": "command", "text": self._renderer.command(window)}

    def _camera(self) -> Camera:
        """The window's camera in its place."""
        assert self._window is not None
        camera = self._window.now.scene.named_cameras()[self._window.camera]
        if camera.fit is None or self._picture is None or self._picture.window.camera != self._window.camera:
            return camera
        return self._picture.camera

    def _read(self) -> None:
        """Read the scene, at first or because its files have changed; edits that it cannot have any more are
        left out."""
        try:
            original = self._renderer.read()
        except Exception as error:
            self._tell_problem(_problem(error), "file")
            self._is_unread = True
            return
        self._is_unread = False
        self._window, problems = reread(self._window, original, self._renderer.loaded)
        self._version += 1
        self._version_read = self._version
        self._is_warm = False
        self._told.clear()
        self._tell_controls(self._window)
        if problems:
            self._tell_problem(problems, "edit")

    # --- answers --------------------------------------------------------------------------------------------

    def _tell_controls(self, window: Window) -> None:
        """Tell the page the values of controls that it does not know; the whole scene if the controls differ
        from those that it has."""
        current = controls(window.original, window.now)
        values = {control.path: control.value for control in current}
        if values.keys() != self._told.keys():
            self._tell(scene_answer(window, current))
        else:
            news = {path: value for path, value in values.items() if value != self._told[path]}
            self._tell({"type": "values", "values": news, "edits": dict(window.edits)})
        self._told = values

    def _tell_problem(self, lines: Sequence[str], origin: str) -> None:
        self._faulty = self._version
        self._tell({"type": "problem", "lines": list(lines), "from": origin})

    def _tell(self, answer: Mapping[str, Any]) -> None:
        self._send(json.dumps(answer))


def _problem(error: Exception) -> list[str]:
    """What an error says to a user; raises it again if it is a fault of the program."""
    if (fault := known(error)) is None:
        raise error
    return str(fault).splitlines()


def _refusal(message: Message, error: Exception) -> list[str]:
    """Why a message was refused; raises what is a fault of the program."""
    if known(error) is None and isinstance(error, MISUNDERSTOOD):
        return [f"message: not understood: {reprlib.repr(message)}: {error}"]
    return _problem(error)


def _stamp(message: Message) -> dict[str, Any]:
    return {"stamp": message["stamp"]} if "stamp" in message else {}
