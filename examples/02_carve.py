"""2. Carving: the voxels that no silhouette contradicts.

python examples/02_carve.py [OUT] writes OUT/hull.ply and OUT/02_carve.png.
"""

import cv2
from common import out_folder, recording_folder

from voxelpose import CarveSettings, carve_recording
from voxelpose.view.images.hull_picture import hull_picture

out = out_folder()

# The volume follows from the silhouettes; volume_m sets another, voxel_size_m the resolution.
hull = carve_recording(
    recording_folder(out),
    out / "hull.ply",
    CarveSettings(frame=2, voxel_size_m=0.015),
    overwrite=True,
)
print(
    f"{hull.volume_l:.0f} litres in voxels of {1000 * hull.grid.voxel_size_m:.0f} mm,"
    f" {hull.occupancy.sum()} of them"
)

cv2.imwrite(str(out / "02_carve.png"), hull_picture(hull.grid, hull.occupancy))
