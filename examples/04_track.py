"""4. Tracking: the motion from one of the cameras.

python examples/04_track.py [OUT] writes OUT/track, a result folder, and OUT/04_track.png.
"""

import shutil

from common import out_folder, recording_folder

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular.making.from_motion import make_library
from silhouette_core.monocular.making.network_training import TrainingSettings
from silhouette_core.monocular.making.proposal_learning import LearningSettings
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.motion.keyposes import keypose_motions
from voxelpose import Output, Recording, Settings, track

out = out_folder()
recording = Recording.open(recording_folder(out), cameras=["cam_2"])

# A small pose library whose proposal learns for a minute. Without the option `library`, the default
# one is made, which learns for many, and kept.
library = out / "small.vplib"
if not library.exists():
    model = BodyModel.from_sizes(BodySizes(stature_m=1.75))
    settings = LibrarySettings(poses=3000)
    training = TrainingSettings(steps=800, batch=256, units=192, blocks=1, modes=4, rate=2e-3)
    short = LearningSettings(
        frames=12_000, takes=30, passes=20, encoding=training, training=training
    )
    make_library(keypose_motions(model), model, library, settings, learning=short)

result = track(
    recording, Output(out / "track", overwrite=True), Settings(options={"library": str(library)})
)

agreement = result.motion.quality["outline_agreement"]
print(
    f"{len(result.motion)} of {recording.frame_count} frames have a pose; outline agreement"
    f" {agreement.min():.2f} to {agreement.max():.2f}"
)

shutil.copy(result.folder / "contact_sheet.png", out / "04_track.png")
