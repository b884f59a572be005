"""What a scene says without effect on its pictures."""

from __future__ import annotations

from illumcli.commands.work import Work
from illumcli.scene.scene_file import lacking_lines, unused_lines


def unused_keys(work: Work) -> list[str]:
    """A line for each value of the scene that has no effect, and for each part that its pictures lack."""
    files = () if work.job.options.pattern else work.scene.outputs.files
    layers = [layer.name for layer in work.outputs]
    lacking = lacking_lines(work.loaded, work.scene, layers)
    return lacking + unused_lines(work.loaded, work.scene, layers, files)
