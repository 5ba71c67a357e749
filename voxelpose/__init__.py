"""Markerless posture estimation from silhouettes, with one camera or several.

The everyday names are imported at their first use, so that `import voxelpose` is fast.
"""

import importlib
from typing import TYPE_CHECKING

from voxelpose.version import __version__ as __version__

if TYPE_CHECKING:
    from calib.errors import InputError as InputError
    from silhouette_core.estimator import Settings as Settings
    from silhouette_core.image.silhouettes import Silhouettes as Silhouettes
    from silhouette_core.motion.conditioning import Conditioning as Conditioning
    from silhouette_core.motion.conditioning import conditioned as conditioned
    from silhouette_core.motion.motion import Motion as Motion
    from voxelpose.demo.room import make_recording as make_recording
    from voxelpose.evaluation import Score as Score
    from voxelpose.evaluation import evaluate as evaluate
    from voxelpose.evaluation import evaluate_people as evaluate_people
    from voxelpose.export.formats import export_motion as export_motion
    from voxelpose.fitting import Output as Output
    from voxelpose.fitting import fit as fit
    from voxelpose.fitting import fit_people as fit_people
    from voxelpose.fitting import track as track
    from voxelpose.hull import CarveSettings as CarveSettings
    from voxelpose.hull import Hull as Hull
    from voxelpose.hull import carve_recording as carve_recording
    from voxelpose.recording.folder import Recording as Recording
    from voxelpose.results import Result as Result
    from voxelpose.results import open_people as open_people
    from voxelpose.scan_distance import ScanScore as ScanScore
    from voxelpose.scan_distance import evaluate_scan as evaluate_scan

_NAMES = {
    "calib.errors": "InputError",
    "silhouette_core.estimator": "Settings",
    "silhouette_core.image.silhouettes": "Silhouettes",
    "silhouette_core.motion.conditioning": "Conditioning conditioned",
    "silhouette_core.motion.motion": "Motion",
    "voxelpose.demo.room": "make_recording",
    "voxelpose.evaluation": "Score evaluate evaluate_people",
    "voxelpose.export.formats": "export_motion",
    "voxelpose.fitting": "Output fit fit_people track",
    "voxelpose.hull": "CarveSettings Hull carve_recording",
    "voxelpose.recording.folder": "Recording",
    "voxelpose.results": "Result open_people",
    "voxelpose.scan_distance": "ScanScore evaluate_scan",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> object:
    """Returns an everyday name, imported at its first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
