"""HTML: a motion with its player in one file, which opens without a server or a network."""

import json
import re
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from silhouette_core.motion.motion import Motion
from voxelpose.export.player_scene import Stage, player_scene

MODULES = ("space", "elements", "shaders", "renderer", "body", "viewpoint", "timeline", "player")
"""Scripts of the player, each after those that it imports."""
_START = """
try {
  window.player = new Player(document.body, JSON.parse(by("scene").textContent));
} catch (error) {
  notice(error.message);
}
"""


def write_html(motion: Motion | Sequence[Motion], path: Path, stage: Stage | None = None) -> None:
    """Writes a motion of at least one pose, or those of several people, as a page that plays it.

    The page holds all that it needs, and asks for nothing: bodies with their skin, skeletons,
    confidence over time, cameras and floor, and the viewer's player. It holds no picture. Axes are
    those of the upright frame, z up, metres.

    Args:
        motion: in any world; their upright frame is shown.
        path: of the file.
        stage: the result's name and its cameras, in the upright frame; None: neither.
    """
    motions = [motion] if isinstance(motion, Motion) else list(motion)
    upright = [one.upright() for one in motions]
    stage = stage or Stage()
    scene = json.dumps(player_scene(upright, upright[0].fps, stage), separators=(",", ":"))
    scene = scene.replace("<", "\\u003c")
    script = one_script([_text(f"{name}.js") for name in MODULES]) + _START
    page = player_page(
        f"{stage.name} – voxelpose",
        f"<style>{_text('base.css')}{_text('player.css')}</style>",
        f'<script id="scene" type="application/json">{scene}</script>\n'
        f'<script type="module">{script}</script>',
    )
    path.write_text(page, encoding="utf-8")


def player_page(title: str, head: str, scripts: str = "") -> str:
    """The player's page: its title, a text, and what more is in its head and its body, HTML."""
    content = {"title": escape(title), "head": head, "scripts": scripts}
    return re.sub(r"/\* (\w+) \*/", lambda mark: content[mark[1]], _text("player.html"))


def _text(name: str) -> str:
    """A file of the player."""
    return files("voxelpose.export").joinpath("page", name).read_text(encoding="utf-8")


def one_script(modules: Sequence[str]) -> str:
    """One script of modules that import from each other alone: a page from a file may load none."""
    joined = "\n".join(modules)
    joined = re.sub(r"^import\b[^;]*;\n", "", joined, flags=re.MULTILINE)
    return re.sub(r"^export ", "", joined, flags=re.MULTILINE)
