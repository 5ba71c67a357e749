"""voxelpose track."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import arg

from silhouette_core import setting_types
from voxelpose.cli import arguments
from voxelpose.cli.fit import EstimationArguments


@dataclass(frozen=True, kw_only=True)
class Track(EstimationArguments):
    """Estimates the motion of a person, or of several, from one camera.

    RECORDING is a video, or a folder with a video per camera and, if possible, calibration.toml and
    background/ with the empty view. Without a calibration, typical camera parameters are assumed.
    OUT receives the same files as from `voxelpose fit`, and hypotheses.csv: the five most probable
    poses of every frame with their probabilities. Of several people OUT/person_1 and so on receive
    them. With the --body of a robot or an animal, a
    library of that body's motion, or poses within the limits of its joints.

      voxelpose track clip.mp4 --out clip_track --stature 1.75
      voxelpose track walk --camera cam_1 --out walk_track --stature 1.75
      voxelpose track talk --camera cam_1 --out talk_track --people 2
      voxelpose track walk --camera cam_1 --library dancers.vplib --start any --out walk_track
      voxelpose track walk --camera cam_1 --out walk_track --cutoff 5 --gap-limit 10
      voxelpose track work --camera cam_1 --body arm.urdf --library arm.vplib --out work_track
      voxelpose track walk --camera cam_1 --method paper --stature 1.75 --out walk_tree
    """

    estimator_options: ClassVar = {name: name for name in ("start", "outline_only", "library")}
    people_seen: ClassVar = False
    people: Annotated[int, arg(metavar="N")] = 1
    """Number of people: each is tracked while the silhouettes are apart. 1: one, whoever else
    passes by."""
    camera: arguments.OptionalName = None
    """Name of the camera. Default: the only one."""
    method: arguments.Method = "learned"
    estimator: arguments.OptionalName = None
    """Estimator to run; `voxelpose doctor` lists those that are installed. Default: --method's."""
    library: Annotated[Path | None, arguments.optional("LIB")] = None
    """Pose library made by `voxelpose library build`, of motion like yours. Default: the network
    that comes with the program."""
    start: setting_types.Start = "facing"
    """Assumption about the first frame: upright and mostly facing the camera, or none."""
    outline_only: Annotated[bool, arg(name="outline-only")] = False
    """Leave out the colours inside the outline, which show arms before the body."""

    @property
    def chosen_estimator(self) -> str:
        """See `EstimationArguments.chosen_estimator`."""
        return self.estimator or arguments.ESTIMATORS[self.method]

    def filmed(self) -> tuple[Path, Sequence[str]]:
        """See `EstimationArguments.filmed`."""
        from voxelpose.recording.folder import one_camera

        folder, camera = one_camera(self.recording, self.camera)
        return folder, (camera,)
