"""FBX: made of motion.glb by Blender, by a script that is written beside it."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from silhouette_core.motion.motion import Motion

SCRIPT, FBX = "to_fbx.py", "motion.fbx"
COMMAND = ("--background", "--factory-startup", "--python-exit-code", "1", "--python", SCRIPT)
_LONGEST_S = 600
_TEXT = '''"""Makes motion.fbx of motion.glb, beside this file, in Blender 4 or 5:

    blender {command}
"""

from pathlib import Path

import bpy

folder = Path(__file__).resolve().parent
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps, scene.render.fps_base = {fps}, {base!r}
bpy.ops.import_scene.gltf(filepath=str(folder / "motion.glb"), disable_bone_shape=True)
ranges = [action.frame_range for action in bpy.data.actions]
scene.frame_start = int(min(first for first, _ in ranges))
scene.frame_end = round(max(last for _, last in ranges))
bpy.ops.export_scene.fbx(
    filepath=str(folder / "motion.fbx"),
    add_leaf_bones=False,
    bake_anim_use_nla_strips=False,
    bake_anim_simplify_factor=0.0,
)
'''


def write_script(motion: Motion | Sequence[Motion], path: Path) -> None:
    """Writes the script, for the frame rate of a motion, or of several people's."""
    rate = (motion if isinstance(motion, Motion) else motion[0]).fps
    fps = max(1, round(rate))
    text = _TEXT.format(command=" ".join(COMMAND), fps=fps, base=fps / rate)
    path.write_text(text, encoding="utf-8")


def make_fbx(folder: Path) -> str:
    """Runs the script of a folder, where Blender is on the path; returns why there is no FBX, or ""
    where there is one.
    """
    (folder / FBX).unlink(missing_ok=True)
    program = shutil.which("blender")
    if program is None:
        return "Blender is not on the path"
    try:
        done = subprocess.run(
            [program, *COMMAND], cwd=folder, capture_output=True, text=True, timeout=_LONGEST_S
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return " ".join(str(error).split())
    if done.returncode or not (folder / FBX).is_file():
        return f"Blender failed: {' '.join((done.stderr or done.stdout).split())[-200:]}"
    return ""
