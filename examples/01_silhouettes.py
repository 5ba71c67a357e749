"""1. Silhouettes: what of every picture is the person.

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

# Pictures by camera name, (H, W, 3) uint8; a recording can be iterated, or be asked for some of its
# time steps.
frames = next(recording.at([6]))
masks = silhouettes.of(frames)  # (H, W) bool by camera name

rows = []
for name, frame in frames.items():
    print(f"{name}: {masks[name].mean():.1%} of the picture is the person")
    cut_out = np.where(masks[name][..., None], frame, 255).astype(np.uint8)
    rows.append(np.vstack([frame, cut_out]))
cv2.imwrite(str(out / "01_silhouettes.png"), np.hstack(rows))
