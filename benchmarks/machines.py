"""Whether results depend on the machine: `python -m benchmarks.machines [--quick] RECORDING ...`

Fits (of one camera, tracks) each recording in a process of its own, once as the machine is, then
with kernels compiled for any processor of its family, with the matrix products and vector
instructions of older processors, and with 1, 2 and 8 threads; with --quick the first three only.
Prints a row each: the median and the largest difference of the joints from the first, mm. The exit
code is 1 where they are more than 1 mm and 5 mm.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from voxelpose.results import Result

MEDIAN_MM, WORST_MM = 1.0, 5.0
MACHINES: dict[str, tuple[int, dict[str, str]]] = {
    "as it is": (2, {}),
    "kernels for any processor": (2, {"NUMBA_CPU_NAME": "generic"}),
    "OpenBLAS of 2013": (2, {"OPENBLAS_CORETYPE": "Haswell"}),
    "OpenBLAS of 2008": (2, {"OPENBLAS_CORETYPE": "Nehalem"}),
    "NumPy without AVX2": (2, {"NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512_SKX"}),
    "1 thread": (1, {}),
    "8 threads": (8, {}),
}


def joints_m(recording: Path, threads: int, environment: dict[str, str], out: Path) -> np.ndarray:
    """Joints (T, 15, 3) of a recording, NaN where there is no pose.

    Raises:
        CalledProcessError: the recording cannot be estimated.
    """
    command = "fit" if len([*recording.glob("cam*.mp4")]) != 1 else "track"
    words = [command, str(recording), "--out", str(out), "--threads", str(threads), "--overwrite"]
    subprocess.run(
        [sys.executable, "-m", "voxelpose", *words],
        env=os.environ | environment,
        check=True,
        capture_output=True,
    )
    motion = Result.open(out).motion
    joints = np.full((int(motion.frames[-1]) + 1, 15, 3), np.nan)
    joints[motion.frames] = motion.landmarks()
    return joints


def main(words: list[str]) -> int:
    """Estimates and compares."""
    quick, *recordings = [*words] if "--quick" in words[:1] else [None, *words]
    if not recordings:
        print(__doc__, file=sys.stderr)
        return 2
    alike = True
    machines = [*MACHINES.items()][: 3 if quick else None]
    print("recording       median_mm   worst_mm  machine")
    with tempfile.TemporaryDirectory() as scratch:
        for name in recordings:
            recording, first = Path(name), None
            for number, (machine, (threads, environment)) in enumerate(machines):
                # Kernels of one processor must not be taken from another's cache.
                cache = {"NUMBA_CACHE_DIR": f"{scratch}/{environment.get('NUMBA_CPU_NAME', '')}"}
                if environment.keys() - {"NUMBA_CPU_NAME"} or not environment:
                    cache = {}
                out = Path(scratch) / f"{recording.name}-{number}"
                joints = joints_m(recording, threads, environment | cache, out)
                first = joints if first is None else first
                away_mm = 1000 * np.linalg.norm(joints - first, axis=2)
                missing = np.isnan(away_mm) & np.isfinite(first).all(axis=2)
                away_mm[missing] = np.inf
                median_mm, worst_mm = np.nanmedian(away_mm), np.nanmax(away_mm)
                alike &= median_mm <= MEDIAN_MM and worst_mm <= WORST_MM
                row = f"{recording.name:<16}{median_mm:>9.3f}{worst_mm:>11.3f}  {machine}"
                print(row, flush=True)
    return int(not alike)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
