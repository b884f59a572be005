"""Standard streams that are closed, full or without a reader: the work is done, with its own exit code."""

from __future__ import annotations

import itertools
import os
import re
import shlex
import subprocess
import sys

import pytest

CLOSED = [
    " ".join(some) for count in range(1, 4) for some in itertools.combinations(("<&-", ">&-", "2>&-"), count)
]
SCENE = (
    "version: 1\nambient: 0.5\nfilm: {width: 8, height: 6, samples: 1}\nobjects: [{mesh: {shape: sphere}}]\n"
)
PIECES = [
    ["schema"],
    ["render", "s.yaml", "-o", "s.exr", "--force"],
    ["render", "none.yaml"],
    ["rendr"],
    ["--help"],
]


def shell(folder, words, redirected):
    """Run the command in bash; the exit code, what stdout and stderr got where they are open."""
    command = shlex.join([sys.executable, "-m", "illumcli", *words])
    done = subprocess.run(
        ["bash", "-c", f"{command} {redirected}"], cwd=folder, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("streams")
    (path / "s.yaml").write_text(SCENE)
    return path


@pytest.mark.parametrize("closed", CLOSED)
def test_closed_streams_change_no_end(folder, closed):
    for words in PIECES:
        (folder / "s.exr").unlink(missing_ok=True)
        code, out, said = shell(folder, words, closed)
        assert code == (2 if words in (["render", "none.yaml"], ["rendr"]) else 0), (words, said)
        assert "Traceback" not in said
        assert bool(out) == (code == 0 and ">&-" not in closed.split()), words
        assert (folder / "s.exr").exists() == ("s.yaml" in words), words


def test_no_file_gets_the_number_of_a_closed_stream(folder):
    done = shell(folder, ["render", "s.yaml", "-o", "v.exr", "-v"], ">&- 2>&-")
    assert done[0] == 0
    compared = shell(folder, ["compare", "v.exr", "v.exr", "--no-flip"], "")
    assert compared[0] == 0, compared


def test_a_reader_that_leaves_stops_nothing(folder):
    for words in (["schema"], ["render", "s.yaml", "-o", "p.exr", "--force"]):
        command = shlex.join([sys.executable, "-m", "illumcli", *words])
        script = f"{command} | exec 3<&0-; echo ${{PIPESTATUS[0]}}"
        done = subprocess.run(["bash", "-c", script], cwd=folder, capture_output=True, text=True, check=False)
        assert (done.stdout, done.stderr) == ("0\n", ""), words
    assert (folder / "p.exr").exists()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
def test_only_paths_that_cannot_be_printed_are_an_error(folder):
    words = ["render", "s.yaml", "-o", "f.exr", "--force"]
    code, _, said = shell(folder, words, ">/dev/full")
    assert (code, len(said.splitlines())) == (5, 1)
    assert said.startswith("standard output: cannot be written: No space left on device")
    assert (folder / "f.exr").exists()
    assert shell(folder, [*words, "-v"], "2>/dev/full")[:2] == (0, "f.exr\n")
    assert shell(folder, ["render", "none.yaml"], ">/dev/full 2>/dev/full")[0] == 2


def test_names_from_files_move_no_terminal(folder):
    """Whatever a file calls its parts: an escape sequence, a NUL, a carriage return, text that runs back."""
    evil = "\x1b]0;owned\x07\x1b[2J\0\r\u202ex"
    (folder / "evil.obj").write_text(
        f"usemtl {evil}\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{evil} 1\nf 1 2 3\nf 1 2 9\n"
    )
    (folder / "evil.yaml").write_text(
        'version: 1\nobjects: [{mesh: evil.obj}, {mesh: "\\e[1m\\0.obj"}]\noutputs: {files: ["\\e[1m.png"]}\n'
    )
    (folder / f"{evil.replace(chr(0), '')}.yaml").write_text("version: 1\nfil: 1\n")
    for words in (
        ["render", "evil.obj", "-o", "evil.png", "-v"],
        ["render", "evil.yaml"],
        ["check", *(str(path.name) for path in folder.glob("*.yaml"))],
        ["plan", "evil.yaml"],
        ["ao-bake", "evil.obj", "-o", "evil.npz"],
        ["render", "s.yaml", "-o", "x\x1b[1m.png"],
        ["sweep", "s.yaml", "-D", "film.exposure=\x1b[1m,2"],
    ):
        code, out, said = shell(folder, words, "")
        assert "Traceback" not in said, said
        assert code in (0, 2), said
        assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", out + said), (words, out, said)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8", "utf-8:strict"])
def test_paths_of_any_bytes_are_printed(folder, encoding):
    names = [b"\xff.yaml", "é漢.yaml".encode()]
    for name in names:
        (folder / os.fsdecode(name)).write_text(SCENE)
    command = [sys.executable, "-m", "illumcli", "check", *names]
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    second = b"\xe9\\u6f22.yaml" if encoding == "latin-1" else names[1]
    assert done.stdout == b"\xff.yaml: ok\n" + second + b": ok\n"
