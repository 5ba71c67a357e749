"""The experiments of Okada and Stenger: python -m papers arm-swing | figure-5, each with --help."""

import sys

import tyro

from calib.errors import InputError
from papers.commands import SUBCOMMANDS


def main(words: list[str]) -> int:
    """Runs an experiment; returns the exit code."""
    word, *rest = words or ["--help"]
    if word not in SUBCOMMANDS:
        print(__doc__, file=sys.stderr)
        return 2
    command = SUBCOMMANDS[word]
    try:
        return tyro.cli(
            command, prog=f"python -m papers {word}", description=command.help, args=rest
        ).run()
    except InputError as error:
        print(f"papers: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
