"""The packages are laid out as docs/architecture.md says, and every public name is used once."""

import ast
import re
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("calib", "silhouette_core", "voxelpose")


def modules() -> list[Path]:
    """Return all modules of the packages, relative to the repository."""
    return sorted(
        path.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).rglob("*.py")
    )


def shares_names(path: Path) -> bool:
    """Whether a module may repeat names and file names: a kernel, or what every estimator has."""
    return "kernels" in path.parts or path.stem in ("__init__", "__main__", "tuning")


def listed_folders() -> set[Path]:
    """Return the folders in the map of docs/architecture.md."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    return {Path(name) for name in re.findall(r"^\| `((?:\w+/)+)` \|", text, re.MULTILINE)}


def test_architecture_maps_every_folder():
    there = {path.parent for path in modules() if path.parent.name != "kernels"}
    assert listed_folders() == there


def test_no_public_name_is_defined_twice():
    homes = defaultdict(list)
    for path in modules():
        if not shares_names(path):
            for node in ast.parse((ROOT / path).read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name[0] != "_":
                    homes[node.name].append(path)
    assert not {name: paths for name, paths in homes.items() if len(paths) > 1}


def test_no_file_name_is_used_twice_in_a_package():
    homes = defaultdict(list)
    for path in modules():
        if not shares_names(path):
            homes[path.parts[0], path.stem].append(path)
    assert not {name: paths for name, paths in homes.items() if len(paths) > 1}
