"""4. Tracking: the motion from one of the cameras.

python examples/04_track.py [OUT] writes OUT/track, a result folder, and OUT/04_track.png.
"""

import shutil

from common import out_folder, recording_folder

from voxelpose import Output, Recording, track

out = out_folder()
recording = Recording.open(recording_folder(out), cameras=["cam_2"])

result = track(recording, Output(out / "track", overwrite=True))

agreement = result.motion.quality["outline_agreement"]
print(
    f"{len(result.motion)} of {recording.frame_count} frames have a pose; outline agreement"
    f" {agreement.min():.2f} to {agreement.max():.2f}"
)

shutil.copy(result.folder / "contact_sheet.png", out / "04_track.png")
