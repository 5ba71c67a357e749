"""voxelpose doctor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Doctor:
    """Arguments of `voxelpose doctor`: none."""

    help: ClassVar[str] = """Checks what works on this machine, with remedies for the rest.

Exit code 0: fitting works; 1: something that fitting needs does not work.

  voxelpose doctor
"""

    def run(self) -> int:
        """Runs all checks and prints their results; returns the exit code."""
        from rich.console import Console
        from rich.table import Table

        from voxelpose.machine_checks import examine
        from voxelpose.version import __version__

        console = Console(highlight=False)
        with console.status("checking ..."):
            checks = examine()
        colours = {"works": "green", "limited": "yellow", "fails": "red"}
        table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
        for check in checks:
            table.add_row(f"[{colours[check.state]}]{check.state}[/]", check.name, check.found)
            if check.remedy:
                table.add_row("", "", f"[bold]-> {check.remedy}[/bold]")
        console.print(f"voxelpose {__version__}")
        console.print(table)
        states = [check.state for check in checks]
        failing = states.count("fails")
        if failing:
            console.print(
                f"{failing} of {len(checks)} do not work: fitting will fail until they do"
            )
        elif "limited" in states:
            console.print("fitting works, with the limits above")
        else:
            console.print("everything works")
        return 1 if failing else 0
