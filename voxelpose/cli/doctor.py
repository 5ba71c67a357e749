"""voxelpose doctor."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from voxelpose.cli import arguments
from voxelpose.cli.terminal import plain, print_table, rich_console


@dataclass(frozen=True)
class Doctor:
    """Checks what works on this machine, with remedies for the rest.

    Exit code 0: fitting works; 1: something that fitting needs does not work.

      voxelpose doctor
      voxelpose doctor --clean .
    """

    clean: Annotated[tuple[Path, ...], arguments.optional("FOLDER...")] = ()
    """Check nothing, but remove what killed runs left in these folders: results and files
    that were being written when they ended."""

    def run(self) -> int:
        """Runs all checks and prints their results, or cleans up; returns the exit code."""
        if self.clean:
            self._clean()
            return 0
        from voxelpose.machine_checks import examine
        from voxelpose.version import __version__

        console = rich_console()
        with console.status("checking ..."):
            checks = examine()
        states = {"good": "[green]works[/]", "look": "[yellow]limited[/]", "bad": "[red]fails[/]"}
        rows = []
        for check in checks:
            rows.append((states[check.level], check.about, plain(check.words)))
            if check.remedy:
                rows.append(("", "", f"[bold]-> {plain(check.remedy)}[/bold]"))
        console.print(f"voxelpose {__version__}")
        print_table(rows)
        levels = [check.level for check in checks]
        failing = levels.count("bad")
        if failing:
            console.print(
                f"{failing} of {len(checks)} do not work: fitting will fail until they do"
            )
        elif "look" in levels:
            console.print("fitting works, with the limits above")
        else:
            console.print("everything works")
        return 1 if failing else 0

    def _clean(self) -> None:
        from calib.storage.atomic import remove_leftovers

        removed = [path for folder in self.clean for path in remove_leftovers(folder)]
        for path in removed:
            print(f"removed {path}")
        if not removed:
            print("killed runs have left nothing there")
