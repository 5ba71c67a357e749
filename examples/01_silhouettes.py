"""1. Silhouettes: the pixels of every image that show the person.

python examples/01_silhouettes.py [OUT] writes OUT/01_silhouettes.png.
"""

import cv2
import numpy as np
from common import out_folder, recording_folder

from voxelpose import Recording, Silhouettes

out = out_folder()
recording = Recording.open(recording_folder(out))

# The background of every camera is learnt from background/, or from the recording itself where that
# is missing.
silhouettes = Silhouettes(recording)

# Images by camera name, (H, W, 3) uint8. Iterating yields all frames, at() those of given steps.
frames = next(recording.at([2]))
masks = silhouettes.of(frames)  # (H, W) bool by camera name

rows = []
for name, frame in frames.items():
    print(f"{name}: {masks[name].mean():.1%} of the image shows the person")
    cut_out = np.where(masks[name][..., None], frame, 255).astype(np.uint8)
    rows.append(np.vstack([frame, cut_out]))
cv2.imwrite(str(out / "01_silhouettes.png"), np.hstack(rows))
