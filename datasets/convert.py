"""Converts a clip of a public data set into a recording folder that voxelpose opens.

    python datasets/convert.py NAME SOURCE OUT [options]

Each data set has a folder beside this file: card.md says what it is, where it comes from and what
its licence allows; recipe.py reads its layout.
"""

import argparse
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))  # recipes import clip.py and truth.py from here; this is no package

# OpenCV and FFmpeg print warnings otherwise; both read this when they are first imported.
os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

from clip import InputError  # noqa: E402
from write import check_out, write  # noqa: E402

_USER_ERROR = 2
_EXAMPLES = """examples:
  python datasets/convert.py --list
  python datasets/convert.py human36m --help
  python datasets/convert.py human36m H36M walk --subject S9 --sequence "Walking 1"
  python datasets/convert.py cmu_panoptic 171204_pose1 OUT --cameras 00_00,00_12 --frames 200:500
  python datasets/convert.py plain FOLDER OUT --unit mm --up y --fps 30 --silhouettes
"""


class _Parser(argparse.ArgumentParser):
    """Reports a wrong argument in one line, like every other error."""

    def error(self, message: str):
        """Ends with code 2."""
        self.exit(_USER_ERROR, f"convert: {message}: see {self.prog} --help\n")


def names() -> list[str]:
    """Returns the data sets that have a recipe."""
    return sorted(path.parent.name for path in HERE.glob("*/recipe.py"))


def recipe(name: str) -> ModuleType:
    """Returns a data set's recipe: SUMMARY, add_options(parser) and read(source, options)."""
    spec = importlib.util.spec_from_file_location(f"recipe_{name}", HERE / name / "recipe.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="convert.py",
        description="Converts a clip of a public data set into a recording that voxelpose opens.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--list", action="store_true", help="list the data sets and end")
    commands = parser.add_subparsers(dest="name", metavar="NAME", title="data sets")
    for name in names():
        module = recipe(name)
        about = f"{module.SUMMARY} See {name}/card.md."
        one = commands.add_parser(name, help=module.SUMMARY, description=about)
        one.set_defaults(read=module.read)
        one.add_argument("source", type=Path, metavar="SOURCE", help="where the data set lies")
        one.add_argument("out", type=Path, metavar="OUT", help="the recording folder to make")
        module.add_options(one.add_argument_group("of this data set"))
        _add_common(one.add_argument_group("of all data sets"))
    return parser


def _add_common(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--cameras", type=_words, metavar="A,B", help="some cameras, by the data set's names"
    )
    group.add_argument(
        "--frames",
        type=_range,
        metavar="A:B",
        help="frames A up to, not including, B; videos are then decoded to PNG images",
    )
    group.add_argument(
        "--silhouettes",
        action="store_true",
        help="leave the images out, so that the data set's masks are used as silhouettes",
    )
    group.add_argument(
        "--label", metavar="N,N", help="labels of the person in the masks (default: found)"
    )
    group.add_argument("--no-truth", action="store_true", help="leave the joint positions out")
    group.add_argument("--stature", type=_stature, metavar="M", help="the subject's height, metres")
    group.add_argument("--sex", choices=("male", "female"), help="of the subject")
    group.add_argument(
        "--copy", action="store_true", help="copy files instead of hard-linking them"
    )
    group.add_argument(
        "--overwrite", action="store_true", help="replace OUT if this command made it"
    )


def _words(text: str) -> tuple[str, ...]:
    words = tuple(word.strip() for word in text.split(",") if word.strip())
    if not words:
        raise argparse.ArgumentTypeError("name at least one")
    return words


def _range(text: str) -> tuple[int | None, int | None]:
    start, colon, stop = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return int(start) if start else None, int(stop) if stop else None
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not A:B, for example 100:400") from None


def _stature(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < 3:
        raise argparse.ArgumentTypeError(f"{text!r} is impossible: give metres, for example 1.75")
    return value


def run(arguments: Sequence[str]) -> int:
    """Runs the command.

    Args:
        arguments: the words after convert.py.

    Returns:
        The exit code: 0 done, 2 an error that the user can correct, in one line on stderr.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.list:
        width = max(map(len, names()))
        print("\n".join(f"{name:<{width}}  {recipe(name).SUMMARY}" for name in names()))
        return 0
    if options.name is None:
        parser.error(f"name a data set ({', '.join(names())})")
    try:
        if not options.source.is_dir():
            raise InputError(f"{options.source} is no folder: give the one that holds the data set")
        check_out(options.out, options.source, options.overwrite)
        print(write(options.read(options.source, options), options.out, options))
    except InputError as error:
        print(f"convert: {' '.join(str(error).split())}", file=sys.stderr)
        return _USER_ERROR
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
