"""How the command ends, whatever happens inside."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import click
import pytest

from illumcli.cli import illum

ENDS = {
    "OSError(28, 'No space left on device', 'x.exr')": (5, "x.exr: No space left on device"),
    "OSError(24, 'Too many open files')": (4, "Too many open files; raise the limit"),
    "OSError(12, 'Cannot allocate memory')": (4, "out of memory"),
    "ImportError('a\\n\\nOriginal error was: failed to map segment')": (4, "failed to map segment"),
    "MemoryError()": (4, "out of memory"),
    "cli._Stopped(signal.SIGTERM)": (-signal.SIGTERM, ""),
}
SCRIPT = """
import os
import signal
import illumcli.cli as cli

def end(*words, **more):
    raise {}

cli.illum.main = end
cli.main()
"""


@pytest.mark.parametrize("error", ENDS)
def test_no_end_is_a_traceback(error):
    code, said = ENDS[error]
    words = [sys.executable, "-c", SCRIPT.format(error)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == bool(said)


FAILING = SCRIPT.replace(
    "    raise {}",
    """    try:
        raise cli._Stopped(signal.SIGINT)
    finally:
        raise RuntimeError("release unlocked lock")
""",
)


def test_an_error_that_a_signal_causes_is_that_signal():
    done = subprocess.run([sys.executable, "-c", FAILING], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")


LINGERING = """
import time
import illumcli.cli as cli
from illumcli.files.atomic import AtomicFile

def lingers(*words, **more):
    part = AtomicFile("picture.exr")
    try:
        print("open", flush=True)
        time.sleep(60)
    finally:
        print("unwinding", flush=True)
        time.sleep(60)

cli.illum.main = lingers
cli.main()
"""


def test_a_second_signal_ends_at_once_and_leaves_no_file(tmp_path):
    words = [sys.executable, "-c", LINGERING]
    with subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        for expected in ("open\n", "unwinding\n"):
            assert run.stdout.readline() == expected
            run.send_signal(signal.SIGINT)
        assert run.wait(timeout=120) == -signal.SIGINT
        assert run.stderr.read() == ""
    assert list(tmp_path.iterdir()) == []


ABORTING = """
import os, time
print("loading", flush=True)
try:
    time.sleep(60)
except BaseException:  # as a library does whose start is interrupted
    os.abort()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("halves", ["", "illumcli.files.atomic"])
def test_a_signal_during_an_import_ends_by_itself(tmp_path, number, halves):
    (tmp_path / "aborting.py").write_text(ABORTING)
    loading = (
        f"import sys, types; import illumcli.cli as cli; sys.modules[{halves!r}] = types.ModuleType('half');"
        "cli.illum.main = lambda **more: __import__('aborting'); cli.main()"
    )
    words = [sys.executable, "-c", loading]
    with subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout.readline() == "loading\n"
        run.send_signal(number)
        assert run.wait(timeout=120) == -number
        assert run.stderr.read() == ""


def commands():
    """The words of every command and subcommand."""
    context = click.Context(illum)
    for name in illum.list_commands(context):
        command = illum.get_command(context, name)
        below = command.commands if isinstance(command, click.Group) else {None: command}
        for sub, each in below.items():
            yield [name] if sub is None else [name, sub], each


def test_quiet_and_verbose_are_the_same_options_of_every_command():
    said = {"quiet": set(), "verbose": set()}
    for words, command in commands():
        options = {option.name: option for option in command.params}
        for letter, name in (("-q", "quiet"), ("-v", "verbose")):
            assert letter in options[name].opts, words
            said[name].add((options[name].help, options[name].is_flag))
    assert [len(each) for each in said.values()] == [1, 1]


@pytest.mark.parametrize("words", [["schema"], ["models"], ["cache", "list"], ["check", "{scene}"]])
def test_commands_that_say_little_take_quiet_and_verbose(tmp_path, words):
    (tmp_path / "s.yaml").write_text("version: 1\nambient: 1\nobjects: [{mesh: {shape: box}}]\n")
    words = [word.format(scene=tmp_path / "s.yaml") for word in words]
    said = {
        subprocess.run(
            [sys.executable, "-m", "illumcli", *words, *more],
            env={**os.environ, "ILLUM_CACHE": str(tmp_path / "cache")},
            capture_output=True, text=True, check=True,
        ).stdout
        for more in ([], ["-q"], ["-v"])
    }  # fmt: skip
    assert len(said) == 1
