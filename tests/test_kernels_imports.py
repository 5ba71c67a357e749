"""What kernel files import, and who imports scoring kernels."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [
    p for name in ("calib", "silhouette_core", "voxelpose") for p in (ROOT / name).rglob("*.py")
]


def imported(path: Path) -> list[str]:
    """The modules that a file imports, by their full names."""
    nodes = list(ast.walk(ast.parse(path.read_text())))
    names = [
        f"{n.module}.{a.name}" for n in nodes if isinstance(n, ast.ImportFrom) for a in n.names
    ]
    return names + [a.name for n in nodes if isinstance(n, ast.Import) for a in n.names]


def test_no_kernel_file_imports_a_kernel():
    """numba's cache would not notice an edit of the imported one."""
    kernels = [path for path in SOURCES if path.parent.name == "kernels"]
    assert len(kernels) > 10
    assert not [
        (path.relative_to(ROOT).as_posix(), name)
        for path in kernels
        for name in imported(path)
        if ".kernels" in name
    ]


def test_scores_go_through_the_backend():
    """Scoring kernels are known to the scoring room alone."""
    assert not [
        path.relative_to(ROOT).as_posix()
        for path in SOURCES
        if path.relative_to(ROOT).parts[:2] != ("silhouette_core", "scoring")
        and any(name.startswith("silhouette_core.scoring.kernels") for name in imported(path))
    ]
