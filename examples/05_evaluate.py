"""5. Evaluating: errors of the results of examples 3 and 4, and export for other programs.

python examples/05_evaluate.py [OUT] writes OUT/export and OUT/05_evaluate.png.
"""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from common import out_folder

from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose import Result, evaluate, export_motion
from voxelpose.evaluation import markdown_table

out = out_folder()
results = {"four cameras": Result.open(out / "fit"), "one camera": Result.open(out / "track")}

# Known positions are in truth.json of the recording; evaluate(result, "my.trc") uses others.
scores = {name: evaluate(result) for name, result in results.items()}
print(markdown_table(scores))

for file in export_motion(
    results["four cameras"].motion, out / "export", ("csv", "glb", "trc"), overwrite=True
):
    print(file)

figure, axes = plt.subplots(figsize=(9, 4), layout="constrained")
for step, (name, score) in enumerate(scores.items()):
    axes.bar(
        np.arange(len(LANDMARK_NAMES)) + 0.4 * step,
        score.joint_root_mm,
        0.4,
        label=f"{name}: {score.root_mm:.0f} mm",
    )
axes.set_xticks(
    np.arange(len(LANDMARK_NAMES)) + 0.2,
    [name.replace("_", " ") for name in LANDMARK_NAMES],
    rotation=45,
    ha="right",
)
axes.set_ylabel("mean error relative to the pelvis, mm")
axes.legend()
figure.savefig(out / "05_evaluate.png", dpi=110)
