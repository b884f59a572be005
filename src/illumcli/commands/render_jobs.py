"""The units of work of `illum render`: every scene, and every frame of one that has frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from illumcli.commands.held_works import HeldWorks
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.unit import Worker
from illumcli.commands.unused import unused_keys
from illumcli.commands.work import Work
from illumcli.errors import InputError, unless_faulty
from illumcli.scene.frames import FRAMES_PER_SECOND, MAX_FRAMES, frame_numbers
from illumcli.scene.load import read_frames


class RenderJobs:
    """The jobs of scenes, in order, and their works.

    Raises
    ------
    InputError
        The option `frames`, or a formula of `frame` in an override, is malformed.
    """

    def __init__(self, scenes: Sequence[Path], options: RenderOptions) -> None:
        self.worker = Worker()
        self._fps: dict[Path, float] = {}
        self._jobs = [job for scene in scenes for job in self._of_scene(scene, options)]
        self._held = HeldWorks(lambda number: self.worker.prepare(self._jobs[number]))
        self._unused: dict[Path, list[str]] = {}

    def __len__(self) -> int:
        return len(self._jobs)

    def __iter__(self) -> Iterator[RenderJob]:
        return iter(self._jobs)

    def _of_scene(self, scene: Path, options: RenderOptions) -> Iterator[RenderJob]:
        """A scene without frames, or each frame of those of the option, or else of the scene."""
        frames = read_frames(scene, options.overrides, self.worker.shared(scene).text)
        fps = self._fps[scene] = frames.fps if frames else FRAMES_PER_SECOND
        numbers = frames.numbers if frames else None
        if options.frames is not None:
            numbers = frame_numbers(options.frames)
        if numbers is None:
            yield RenderJob(scene, options)
        elif len(numbers) > MAX_FRAMES:
            raise InputError(f"{len(numbers)} frames are more than {MAX_FRAMES}; render them in parts")
        for number in numbers or ():
            overrides = overrides_at(options.overrides, number, fps)
            yield RenderJob(scene, replace(options, overrides=overrides), number)

    def unit(self, number: int) -> RenderJob:
        """A job, by its index."""
        return self._jobs[number]

    def label(self, number: int) -> str:
        """What messages call a job, beside its scene."""
        frame = self._jobs[number].frame
        return "" if frame is None else f"frame {frame}"

    def planned(self, number: int) -> Work:
        """The work of a job; the values of its scene that have an effect are noted."""
        work, scene = self.work(number), self._jobs[number].scene
        lines = unused_keys(work)
        self._unused[scene] = [line for line in self._unused.get(scene, lines) if line in lines]
        return work

    def work(self, number: int) -> Work:
        """The work of a job, held until it is dropped."""
        return self._held.of(number)

    def drop(self, number: int) -> None:
        """Drop the work of a job that is done."""
        self._held.drop(number)

    def fps(self, scene: Path) -> float:
        """Frames per second of a scene."""
        return self._fps[scene]

    def following(self, number: int) -> Work | None:
        """The work of the next frame of the same scene; None if there is none, or it has a fault."""
        if number + 1 == len(self) or self._jobs[number + 1].scene != self._jobs[number].scene:
            return None
        return unless_faulty(partial(self.work, number + 1))

    def unused(self, scene: Path) -> list[str]:
        """A line for each value of a scene that has no effect at any frame, when first asked for."""
        return self._unused.pop(scene, [])


def overrides_at(overrides: Sequence[str], frame: int, fps: float) -> tuple[str, ...]:
    """Overrides with the values of their formulas of `frame` and `time`."""
    if not overrides:
        return ()
    from illumcli.scene.variants import at_frame  # few renders of frames have overrides

    pairs = [(text, *text.partition("=")) for text in overrides]
    return tuple(
        f"{path}={at_frame(path, value, frame, fps)}" if equals else text
        for text, path, equals, value in pairs
    )
