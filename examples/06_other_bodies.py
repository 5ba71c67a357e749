"""6. Other bodies: the same fit with a body that is no person's, here a robot arm from its URDF.

python examples/06_other_bodies.py [OUT] writes OUT/robot_arm_fit, a result folder, and
OUT/06_other_bodies.png.
"""

import shutil

import numpy as np
from bodies.example_motions import TRUE_MOTION, film_example
from common import out_folder

from silhouette_core.motion.motion_file import read_motion
from voxelpose import Output, Recording, Settings, fit

out = out_folder()
folder = out / "robot_arm"
if not (folder / TRUE_MOTION).exists():
    film_example(folder, "robot_arm", 12)

# The body is the robot's own file: its links, joints with their limits, and shapes.
settings = Settings(options={"body": str(folder / "robot_arm.urdf")})
result = fit(Recording.open(folder), Output(out / "robot_arm_fit", overwrite=True), settings)

motion, truth = result.motion, read_motion(folder / TRUE_MOTION)
rows = np.searchsorted(truth.frames, motion.frames)
error_deg = np.degrees(np.abs(motion.angles_rad - truth.angles_rad[rows])).mean(axis=0)
for name, degrees in zip(motion.model.tree.dof_names, error_deg, strict=True):
    print(f"{name}: {degrees:.2f} degrees from the truth")
error_mm = 1000 * np.linalg.norm(motion.landmarks() - truth.landmarks()[rows], axis=2)
print(f"joints: {error_mm.mean():.1f} mm from the truth")

shutil.copy(result.folder / "contact_sheet.png", out / "06_other_bodies.png")
