"""voxelpose doctor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Doctor:
    """The arguments of `voxelpose doctor`: none."""

    help: ClassVar[str] = """Says what of this machine works, and what to do about the rest.

Exit code 0: fitting works; 1: something that it needs does not.

  voxelpose doctor
"""

    def run(self) -> int:
        """Examines."""
        from rich.console import Console
        from rich.table import Table

        from voxelpose import __version__
        from voxelpose.doctor import examine

        console = Console(highlight=False)
        with console.status("looking ..."):
            findings = examine()
        colours = {"works": "green", "limited": "yellow", "fails": "red"}
        table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
        for finding in findings:
            table.add_row(
                f"[{colours[finding.state]}]{finding.state}[/]", finding.name, finding.found
            )
            if finding.remedy:
                table.add_row("", "", f"[bold]-> {finding.remedy}[/bold]")
        console.print(f"voxelpose {__version__}")
        console.print(table)
        failing = sum(finding.state == "fails" for finding in findings)
        limited = sum(finding.state == "limited" for finding in findings)
        if failing:
            console.print(
                f"{failing} of {len(findings)} do not work: fitting will fail until they do"
            )
        elif limited:
            console.print("fitting works, with the limits above")
        else:
            console.print("everything works")
        return 1 if failing else 0
