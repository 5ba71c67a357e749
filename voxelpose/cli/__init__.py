"""Command line `voxelpose`.

Slow imports are left to the commands' `run`, so that help is printed at once.
"""

import errno
import inspect
import os
import shutil
import signal
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from calib.errors import InputError, check_name
from calib.storage.atomic import written_paths
from calib.storage.temporary import private_folder
from voxelpose.cli.terminal import VisibleStream, message

COMMANDS = {
    "demo": "render a small recording, fit it and score it: a first result",
    "studio": "everything in the browser, from recorded files to exported motion",
    "fit": "estimate the motion of a person from several cameras",
    "setup": "draw regions, click points and check a recording in the browser",
    "calibrate": "calibrate cameras, convert and check calibrations",
    "track": "estimate the motion of a person from one camera",
    "batch": "fit or track many recordings, and compare the results",
    "live": "follow a person before running cameras, and send the motion",
    "carve": "carve the visual hull of one frame, as a PLY file",
    "body": "bodies by name and from measurements, for --body",
    "network": "install a pose network that helps where silhouettes are poor",
    "library": "build or describe a pose library for track",
    "view": "show a result in the browser, in a window, as image or video",
    "correct": "correct a result by hand: trim, exchange sides or people",
    "export": "write a result as BVH, glTF, TRC, MOT, C3D, CSV or NPZ",
    "report": "write a page about a result: joint angles, quality, advice",
    "evaluate": "score a result against known joint positions",
    "settings": "show the settings that voxelpose.toml files give, and where from",
    "warm-up": "compile everything once, for installers",
    "doctor": "check what works on this machine, with remedies for the rest",
}
_HELP = """usage: voxelpose [-h] [--version] COMMAND ...

Motion of a person from silhouettes in video, without markers.

commands:
{commands}

examples:
  voxelpose demo --out demo                            a first result, without any data
  voxelpose fit RECORDING --out OUT --stature 1.75     your own recording
  voxelpose COMMAND --help                             arguments of a command
"""
_BEGINNING = """\
  voxelpose studio         everything in the browser, from recorded files to exported motion
  voxelpose demo           a first result, without any data
  voxelpose --help         all commands"""

# Reasons of the system that are no bug, wherever they appear.
_OF_THE_SYSTEM = (
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.ENAMETOOLONG,
    errno.ELOOP,
    errno.ENOSPC,
    errno.EDQUOT,
)
_MOST_NAMED = 5  # of the files that an interrupted command had written
_USER_ERROR = 2
_INTERRUPTED = 130
_READER_GONE = 141


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs a command, the arguments after `voxelpose` or those of the process, and ends the
    process.

    Exit codes: 0 done; 1 a check failed, or a bug, with its traceback; 2 an error that the user can
    correct, in one line on stderr; 130 interrupted; 141 nobody reads the output any more.
    """
    # OpenCV and FFmpeg would print messages between ours.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # SIGTERM, as sent by job schedulers, cleans up like Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        stream.reconfigure(errors="backslashreplace")  # what the terminal's encoding lacks
        setattr(sys, name, VisibleStream(stream))
    try:
        try:
            code = run(sys.argv[1:] if arguments is None else arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output has gone, as `head` does. What is left in the buffer goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = _READER_GONE
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Runs a command, the arguments after `voxelpose`; returns the exit code. SystemExit where the
    arguments are wrong (code 2), or help was requested (code 0).
    """
    if not arguments:
        print(f"{_HELP.splitlines()[0]}\n\n{_BEGINNING}")
        return 0
    name, *rest = arguments
    if name in ("-h", "--help"):
        print(_HELP.format(commands=_listing(COMMANDS)), end="")
        return 0
    if name in ("-V", "--version"):
        from voxelpose.version import __version__

        print(f"voxelpose {__version__}")
        return 0
    try:
        if name not in COMMANDS:
            raise InputError(
                f"there is no command {name!r}: the commands are {', '.join(COMMANDS)}"
            )
        for word in (*rest, Path.cwd()):
            check_name(word)
        if not os.access(os.path.expanduser("~"), os.W_OK):  # noqa: PTH111, pathlib's raises
            # matplotlib would make a folder of its own, and say so, every time.
            os.environ.setdefault("MPLCONFIGDIR", str(private_folder()))
        return _parse(name, rest).run() or 0
    except InputError as error:
        _print_line(error)
        return _USER_ERROR
    except OSError as error:
        if error.errno not in _OF_THE_SYSTEM or error.filename is None:
            raise
        _print_line(f"{error.filename}: {error.strerror}")
        return _USER_ERROR
    except KeyboardInterrupt as interrupt:
        written = [str(path) for path in written_paths()[-_MOST_NAMED:]]
        state = f"written before: {', '.join(written)}" if written else "nothing was written"
        words = "".join(f" {word}" for word in interrupt.args)
        _print_line(f"interrupted{words}; {state}")
        return _INTERRUPTED


def _parse(name: str, words: list[str]):
    """Returns a command with its arguments; its `run` returns the exit code, or None for 0."""
    from voxelpose.cli.options import commands_of, parse_with_settings

    section, commands = name, commands_of(name)
    if name not in commands:
        subcommands = {known.partition(".")[2]: command for known, command in commands.items()}
        word, words = _subcommand(name, subcommands, words)
        section = f"{name}.{word}"
    if not {"-h", "--help"}.isdisjoint(words):
        # tyro would join the lines of a description, and not wrap them.
        print(_wrapped(f"{inspect.getdoc(commands[section])}\n"))
    command, taken = parse_with_settings(section, words, f"voxelpose {section.replace('.', ' ')}")
    for file in dict.fromkeys(setting.file for setting in taken.values()):
        names = ", ".join(name for name, setting in taken.items() if setting.file == file)
        _print_line(f"from {file} [{section}]: {names}")
    return command


def _print_line(text: object) -> None:
    print(f"voxelpose: {message(text)}", file=sys.stderr)


def _subcommand(name: str, commands: Mapping[str, Any], words: list[str]) -> tuple[str, list[str]]:
    """Returns name and arguments of a subcommand; prints a list where help is requested."""
    word, *rest = words or ["--help"]
    if word in ("-h", "--help"):
        docs = {word: inspect.getdoc(command) or "" for word, command in commands.items()}
        listing = _listing({word: text.splitlines()[0] for word, text in docs.items()})
        print(
            f"usage: voxelpose {name} [-h] COMMAND ...\n\ncommands:\n{listing}\n\n"
            f"voxelpose {name} COMMAND --help lists the arguments of a command"
        )
        raise SystemExit(0)
    if word not in commands:
        names = ", ".join(f"{name} {word}" for word in commands)
        raise InputError(f"there is no command '{name} {word}': there are {names}")
    return word, rest


def _listing(commands: Mapping[str, str]) -> str:
    return "\n".join(f"  {name:<12}{summary}" for name, summary in commands.items())


def _wrapped(text: str) -> str:
    """Returns a help text wrapped to the terminal, except for paragraphs that are indented."""
    width = shutil.get_terminal_size().columns
    return "\n\n".join(
        paragraph if paragraph.startswith(" ") else textwrap.fill(paragraph, width)
        for paragraph in text.split("\n\n")
    )
