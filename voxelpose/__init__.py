"""Markerless posture estimation from silhouettes, with one camera or several.

The everyday names are imported at their first use, so that `import voxelpose` is fast.
"""

import importlib
from typing import TYPE_CHECKING

from voxelpose.version import __version__ as __version__

if TYPE_CHECKING:
    from calib.errors import InputError
    from silhouette_core.estimator import Settings
    from silhouette_core.image.silhouettes import Silhouettes
    from silhouette_core.motion.conditioning import Conditioning, conditioned
    from silhouette_core.motion.motion import Motion
    from voxelpose.demo.room import make_recording
    from voxelpose.evaluation import Score, evaluate
    from voxelpose.export.formats import export_motion
    from voxelpose.fitting import Output, fit, track
    from voxelpose.hull import CarveSettings, Hull, carve_recording
    from voxelpose.recording.folder import Recording
    from voxelpose.results import Result


__all__ = [
    "CarveSettings",
    "Conditioning",
    "Hull",
    "InputError",
    "Motion",
    "Output",
    "Recording",
    "Result",
    "Score",
    "Settings",
    "Silhouettes",
    "carve_recording",
    "conditioned",
    "evaluate",
    "export_motion",
    "fit",
    "make_recording",
    "track",
]

_MODULES = {
    "CarveSettings": "voxelpose.hull",
    "Conditioning": "silhouette_core.motion.conditioning",
    "Hull": "voxelpose.hull",
    "InputError": "calib.errors",
    "Motion": "silhouette_core.motion.motion",
    "Output": "voxelpose.fitting",
    "Recording": "voxelpose.recording.folder",
    "Result": "voxelpose.results",
    "Score": "voxelpose.evaluation",
    "Settings": "silhouette_core.estimator",
    "Silhouettes": "silhouette_core.image.silhouettes",
    "carve_recording": "voxelpose.hull",
    "conditioned": "silhouette_core.motion.conditioning",
    "evaluate": "voxelpose.evaluation",
    "export_motion": "voxelpose.export.formats",
    "fit": "voxelpose.fitting",
    "make_recording": "voxelpose.demo.room",
    "track": "voxelpose.fitting",
}


def __getattr__(name: str) -> object:
    """Returns an everyday name, imported at its first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Returns all names, including everyday names that are not imported yet."""
    return sorted({*globals(), *__all__})
