"""voxelpose warm-up."""

from dataclasses import dataclass

from voxelpose.cli.terminal import Progress


@dataclass(frozen=True)
class WarmUp:
    """Compiles what fit and track need, so that first runs are fast.

    For installers: once after an installation, as the user whose runs it is for, or with
    NUMBA_CACHE_DIR set to a folder that they share. It takes about a minute.

      voxelpose warm-up
      NUMBA_CACHE_DIR=/opt/voxelpose/cache voxelpose warm-up
    """

    def run(self) -> None:
        """Compiles."""
        from voxelpose.compile_ahead import compile_kernels, kernels

        with Progress() as progress:
            wanted = kernels(("multiview", "monocular"))
            compile_kernels(wanted, progress)
        print(f"{len(wanted)} functions are compiled")
