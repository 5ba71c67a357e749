"""The command line. Nothing heavy is imported here or in the commands' modules: `voxelpose --help`
answers at once.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from types import FrameType

from calib.errors import InputError

COMMANDS = {
    "demo": "make a small recording, fit it and score it: a first result without any data",
    "fit": "fit a body to every frame of a recording and write its motion",
    "calibrate": (
        "print boards, calibrate lenses and places of cameras, convert and check calibrations"
    ),
    "track": "follow one person in the pictures of one camera and write the motion",
    "carve": "carve one frame of a recording: its visual hull as a PLY file",
    "library": "make or describe a pose library, from which one camera's motion is estimated",
    "view": (
        "show a result in the browser: cameras, voxels and body over time; or as a window, picture"
        " or video"
    ),
    "export": "write a result as BVH, glTF, TRC, MOT, C3D, CSV or NPZ, for other programs",
    "report": "write one page about a result: pictures, joint angles, quality, what to do",
    "evaluate": "score a result against known joint positions",
    "experiment": "repeat the experiments of Okada and Stenger's paper",
    "doctor": "say what of this machine works, and what to do about the rest",
}
_HELP = """usage: voxelpose [-h] [--version] COMMAND ...

Motion from silhouettes, in ordinary video, on an ordinary CPU.

commands:
{commands}

examples:
  voxelpose demo --out demo                            a first result, without any data
  voxelpose fit RECORDING --out OUT --stature 1.75     your own recording
  voxelpose COMMAND --help                             all about a command
"""

_USER_ERROR = 2
_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs a command and ends the process.

    Exit codes: 0 done; 1 a check failed (doctor), or a bug, with its traceback; 2 something the
    user can mend, in one line on stderr; 130 interrupted.

    Args:
        arguments: the words after `voxelpose`; None: those of the process.
    """
    # OpenCV and FFmpeg would talk between our lines.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # A job scheduler's SIGTERM cleans up like Ctrl-C.
    signal.signal(signal.SIGTERM, _interrupt)
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: Sequence[str]) -> int:
    """Runs a command.

    Args:
        arguments: the words after `voxelpose`.

    Returns:
        The exit code.

    Raises:
        SystemExit: the arguments are wrong (code 2), or help was asked for (code 0).
    """
    name, *rest = arguments or ["--help"]
    if name in ("-h", "--help"):
        print(
            _HELP.format(
                commands="\n".join(f"  {command:<12}{does}" for command, does in COMMANDS.items())
            ),
            end="",
        )
        return 0
    if name in ("-V", "--version"):
        from voxelpose import __version__

        print(f"voxelpose {__version__}")
        return 0
    try:
        if name not in COMMANDS:
            raise InputError(
                f"there is no command {name!r}: the commands are {', '.join(COMMANDS)}"
            )
        return _parse(name, rest).run()
    except InputError as error:
        print(f"voxelpose: {' '.join(str(error).split())}", file=sys.stderr)
        return _USER_ERROR
    except KeyboardInterrupt as interrupt:
        print(
            f"voxelpose: interrupted{''.join(f' {word}' for word in interrupt.args)}; nothing was"
            " written",
            file=sys.stderr,
        )
        return _INTERRUPTED


def _parse(name: str, words: list[str]):
    """Returns the command with its arguments; its class is called as its module, or is one of the
    module's SUBCOMMANDS.
    """
    import tyro

    module = importlib.import_module(f"voxelpose.cli.{name}")
    if hasattr(module, "SUBCOMMANDS"):
        name, command, words = _second_word(name, module.SUBCOMMANDS, words)
    else:
        command = getattr(module, name.capitalize())
    return tyro.cli(command, prog=f"voxelpose {name}", description=command.help, args=words)


def _second_word(
    name: str, commands: Mapping[str, type], words: list[str]
) -> tuple[str, type, list[str]]:
    """Returns the full name of a command of two words, its class and what follows; lists them where
    help is asked for.
    """
    word, *rest = words or ["--help"]
    if word in ("-h", "--help"):
        does = "\n".join(
            f"  {word:<12}{command.help.splitlines()[0]}" for word, command in commands.items()
        )  # type: ignore[attr-defined]
        print(
            f"usage: voxelpose {name} [-h] COMMAND ...\n\ncommands:\n{does}\n\nvoxelpose {name}"
            " COMMAND --help tells all about a command"
        )
        raise SystemExit(0)
    if word not in commands:
        raise InputError(
            f"there is no command '{name} {word}': there are"
            f" {', '.join(f'{name} {word}' for word in commands)}"
        )
    return f"{name} {word}", commands[word], rest


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
