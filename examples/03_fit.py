"""3. Fitting: the pose of the body in every frame, from all cameras.

python examples/03_fit.py [OUT] writes OUT/fit, a result folder, and OUT/03_fit.png.
"""

import shutil

import numpy as np
from common import out_folder, recording_folder

from voxelpose import Output, Recording, Settings, fit

out = out_folder()
recording = Recording.open(recording_folder(out))

# Measures that are not set are taken from subject.toml (here the stature), or estimated.
result = fit(recording, Output(out / "fit", overwrite=True), Settings())

motion = result.motion
print(
    f"{len(motion)} of {recording.frame_count} frames have a pose; joints"
    f" {motion.landmarks().shape}, metres"
)
knee = motion.angles_rad[:, motion.model.tree.dof_names.index("left_shin.flexion")]
print(f"left knee: {np.degrees(knee.min()):.0f} to {np.degrees(knee.max()):.0f} degrees")
print(f"fraction of the hull outside the body: {np.median(motion.quality['unexplained']):.0%}")

shutil.copy(result.folder / "contact_sheet.png", out / "03_fit.png")
