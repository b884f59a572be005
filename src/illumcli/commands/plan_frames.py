"""What the frames of a scene compute: buffers that are the same at all of them, and others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from illumcli.commands.render_jobs import RenderJobs
from illumcli.records import Value
from illumcli.render_graph.keys import Keys


class PlannedFrames(Value):
    """The frames of a plan."""

    numbers: list[int]
    different: Mapping[str, Mapping[str, int]]
    """Camera -> buffer -> how many different ones the frames need."""


def planned_frames(jobs: RenderJobs) -> PlannedFrames | None:
    """The frames of the jobs of one scene, and what differs between them; None if it has no frames.

    Raises
    ------
    InputError
        A frame has a fault.
    """
    numbers = [job.frame for job in jobs if job.frame is not None]
    if not numbers:
        return None
    keys: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for number in range(len(jobs)):
        work = jobs.work(number)
        buffers = [*(layer.buffer for layer in work.outputs), "alpha"]
        order = work.graph.topological_order(buffers)
        for view in work.graph.views:
            key_of = Keys(work.graph.nodes, view, "")
            for node in order:
                keys[view.name][node.output].add(key_of(node.output))
        jobs.drop(number)
    different = {
        camera: {name: len(each) for name, each in of_camera.items()} for camera, of_camera in keys.items()
    }
    return PlannedFrames(numbers, different)
