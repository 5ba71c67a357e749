"""The packages are laid out as docs/architecture.md says, every public name is used once, tuned
numbers stand in the files `tuning.py`, and nothing grows beyond tests/limits.toml.
"""

import ast
import re
import tomllib
from collections import defaultdict
from functools import cache
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("calib", "silhouette_core", "voxelpose")
UNITS = set(
    "1 m m² m³ m/s mm s Hz px Metres Pixels Degrees Radians Seconds Statures Squares Noise Grey"
    " Squared Nats Logarithm Bins Frames Voxels Nodes Places Placements Poses Modes Sigmas".split()
)
# Words that say nothing of the data they would name.
VAGUE = set("found told shown own at kept again there things mine theirs".split())


def modules() -> list[Path]:
    """Return all modules of the packages, relative to the repository."""
    return sorted(
        path.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).rglob("*.py")
    )


@cache
def tree(path: Path) -> ast.Module:
    """Return the syntax of a module, relative to the repository."""
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


def body(path: Path) -> list[ast.stmt]:
    """Return the statements of a module."""
    return tree(path).body


def tuned_numbers() -> list[tuple[str, str]]:
    """Return the fields of all files `tuning.py`, and what is said beside or below each."""
    found = []
    for path in modules():
        if path.stem == "tuning":
            lines = (ROOT / path).read_text(encoding="utf-8").splitlines()
            for node in body(path):
                members = [*node.body, None] if isinstance(node, ast.ClassDef) else [None]
                for field, after in pairwise(members):
                    if isinstance(field, ast.AnnAssign):
                        below = isinstance(after, ast.Expr) and ast.literal_eval(after.value)
                        said = below or lines[field.end_lineno - 1].partition("#: ")[2]
                        found.append((f"{path}: {ast.unparse(field)}", said))
    return found


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
            for node in body(path):
                if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name[0] != "_":
                    homes[node.name].append(path)
    assert not {name: paths for name, paths in homes.items() if len(paths) > 1}


def test_what_is_imported_of_ours_is_there():
    ours = {path.name for path in ROOT.iterdir() if path.is_dir()}
    missing = [
        f"{path.relative_to(ROOT)}: {node.module} {name.name}"
        for folder in (*PACKAGES, "benchmarks", "examples", "papers", "tests", "tools")
        for path in (ROOT / folder).rglob("*.py")
        for node in ast.walk(tree(path.relative_to(ROOT)))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in ours
        for name in node.names
        if not is_there(ROOT.joinpath(*node.module.split(".")), name.name)
    ]
    assert not missing


def is_there(module: Path, name: str) -> bool:
    """Whether a module or package of ours has a name."""
    if (module / name).is_dir() or (module / f"{name}.py").exists():
        return True
    file = module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
    return file.exists() and name in words_of(file)


@cache
def words_of(file: Path) -> frozenset[str]:
    """Return the words of a file."""
    return frozenset(re.findall(r"\w+", file.read_text("utf-8")))


def test_no_file_name_is_used_twice_in_a_package():
    homes = defaultdict(list)
    for path in modules():
        if not shares_names(path):
            homes[path.parts[0], path.stem].append(path)
    assert not {name: paths for name, paths in homes.items() if len(paths) > 1}


def test_no_float_stands_at_module_level_outside_tuning():
    assert not [
        f"{path}: {ast.unparse(node)}"
        for path in modules()
        if path.stem != "tuning"
        for node in body(path)
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and isinstance(part.value, float)
    ]


def test_every_tuned_number_has_a_unit_and_a_meaning():
    told = [(field, said.split()) for field, said in tuned_numbers()]
    assert not [field for field, said in told if len(said) < 2 or said[0].strip(".,") not in UNITS]


def test_data_is_named_by_what_it_is():
    assert not [
        f"{path}:{node.lineno}: {name}"
        for path in modules()
        for node in ast.walk(tree(path))
        if isinstance(node, ast.arg | ast.Name)
        and not isinstance(getattr(node, "ctx", None), ast.Load)
        and (name := node.arg if isinstance(node, ast.arg) else node.id).strip("_") in VAGUE
    ]


def lines(folder: str, *endings: str) -> int:
    """Return the number of lines of a folder's files with some endings."""
    files = (path for path in (ROOT / folder).rglob("*.*") if path.suffix in endings)
    return sum(path.read_bytes().count(b"\n") for path in files)


def test_nothing_grows_beyond_its_limit():
    docs = [path for path in (ROOT / "docs").rglob("*.md") if "reference" not in path.parts]
    sizes = {
        **{f"lines of {folder}": lines(folder, ".py") for folder in (*PACKAGES, "tests")},
        "lines of pages": lines("voxelpose", ".js", ".css", ".html"),
        "tuned numbers": len(tuned_numbers()),
        "words of docs": sum(len(path.read_text(encoding="utf-8").split()) for path in docs),
    }
    limits = tomllib.loads((ROOT / "tests" / "limits.toml").read_text(encoding="utf-8"))
    assert limits.keys() == sizes.keys()
    assert not {name: size for name, size in sizes.items() if size > limits[name]}
