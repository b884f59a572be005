"""Work before rendering grows in proportion to the parts of a scene, not with their square."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.unused import unused_keys
from illumcli.commands.work import prepared
from illumcli.render_graph.schedule import schedule

PARTS = {
    "objects": "objects: [{part}]",
    "objects with materials": "objects: [{part}]",
    "lights": "objects: [{{mesh: {{shape: disc}}}}]\nlights: [{part}]",
    "materials": "objects: [{{mesh: a.obj}}, {{mesh: b.obj}}]\nmaterials: {{{part}}}",
    "cameras": "objects: [{{mesh: {{shape: disc}}}}]\ncameras: {{{part}}}",
}
PART = {
    "objects": "{{mesh: m{k}.ply, transform: {{translate: [{k}, 0, 0]}}}}",
    "objects with materials": "{{mesh: a.ply, material: {{model: lambert}}, override: {{diffuse: 0.{k}}}}}",
    "lights": "{{light: point, position: [{k}, 1, 0]}}",
    "materials": "m{k}: {{model: lambert, diffuse: 0.5}}",
    "cameras": "c{k}: {{position: [{k}, 0, 1], target: [{k}, 0, 0]}}",
}


def instructions(path: Path) -> int:
    """How many instructions of this program planning a scene takes."""
    count = 0

    def trace(frame, event, argument):
        nonlocal count
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        count += event == "opcode"
        return trace

    sys.settrace(trace)
    try:
        work = prepared(RenderJob(path, RenderOptions(pattern="{camera}.png")))
        unused_keys(work)
        schedule(work.graph, work.outputs, work.graph.views[0])
    finally:
        sys.settrace(None)
    return count


@pytest.mark.parametrize("kind", PARTS)
def test_planning_is_linear(tmp_path, kind):
    for name in ("a.obj", "b.obj", "a.ply", *(f"m{k}.ply" for k in range(80))):
        (tmp_path / name).touch()
    counts = []
    for size in (10, 20, 40, 80):
        part = ", ".join(PART[kind].format(k=k) for k in range(size))
        (tmp_path / f"{size}.yaml").write_text(f"version: 1\n{PARTS[kind].format(part=part)}\n")
        counts.append(instructions(tmp_path / f"{size}.yaml"))
    _, few, more, most = counts  # the first run imports
    each, next_each = (more - few) / 20, (most - more) / 40
    assert next_each < 1.01 * each, (next_each / each, counts)
