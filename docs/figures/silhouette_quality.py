"""Draws good and bad silhouettes: `python -m docs.figures.silhouette_quality` writes
docs/images/silhouette_quality.jpg.

The demo's renderer films, the program's own background subtraction segments. Each picture shows
what was filmed and, below it, the silhouette: what is missing in red, what is too much in yellow,
against the true outline.
"""

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.files import write_rig
from docs.figures.drawing import INK, QUIET, blank, centred, save
from silhouette_core.image.raster import render_parts
from silhouette_core.image.silhouettes import Silhouettes
from voxelpose.demo.choreography import performances
from voxelpose.demo.mannequin import COLOURS_BGR, SHIRT, TROUSERS, Mannequin
from voxelpose.demo.room import FilmCamera, demo_rig, write_video
from voxelpose.recording.folder import Recording
from voxelpose.view.images.canvas import Image

FPS, FRAMES, SHOWN = 15, 45, 24
_CROP = slice(90, 430), slice(170, 470)  # rows and columns that are shown
_MISSING, _TOO_MUCH = (60, 60, 230), (40, 200, 250)


@dataclass(frozen=True, eq=False)
class Case:
    """One way of filming.

    Attributes:
        title: what is shown.
        remark: why it is good or bad.
        performance: what the actor does.
        colours_bgr: clothes.
        shadow: share of the light that the actor keeps from the floor.
        background: whether the empty view is filmed.
    """

    title: str
    remark: str
    performance: str = "pointing"
    colours_bgr: NDArray[np.float64] = field(default_factory=COLOURS_BGR.copy)
    shadow: float = 0.38
    background: bool = True


def _wall_coloured() -> NDArray[np.float64]:
    colours = COLOURS_BGR.copy()
    colours[SHIRT], colours[TROUSERS] = (190, 184, 170), (112, 126, 118)
    return colours


CASES = (
    Case("good", "empty view filmed, clothes unlike the room"),
    Case("hard shadow", "one bare lamp: the shadow is nearly black", shadow=0.93),
    Case(
        "clothes like the room",
        "shirt like the wall, trousers like the floor",
        colours_bgr=_wall_coloured(),
    ),
    Case("no empty view", "what never moves becomes background", background=False),
)


def film(case: Case, folder: Path) -> tuple[Image, NDArray[np.bool_], NDArray[np.bool_]]:
    """Films a case.

    Returns:
        A frame (480, 640, 3), its silhouette (480, 640), and the true one.
    """
    camera = demo_rig(2)["cam_2"]
    actor, played = Mannequin.build(), performances()[case.performance]
    view = FilmCamera(camera, np.random.default_rng(5), case.colours_bgr, case.shadow)
    poses = [actor.pose(*played.pose_at(frame / FPS))[0] for frame in range(FRAMES)]
    folder.mkdir(parents=True)
    write_rig(Rig((camera,)), folder / "calibration.toml")
    if case.background:
        (folder / "background").mkdir()
        write_video(folder / "background" / "cam_2.mp4", FPS, (view.empty() for _ in range(20)))
    write_video(
        folder / "cam_2.mp4", FPS, (view.picture(v, actor.faces, actor.face_colour) for v in poses)
    )
    recording = Recording.open(folder)
    frames = next(recording.at([SHOWN]))
    true = render_parts(
        poses[SHOWN] @ camera.rotation.T + camera.translation,
        actor.faces,
        np.zeros(len(actor.faces), np.int32),
        camera.matrix,
        camera.size,
    )[0]
    return frames["cam_2"], Silhouettes(recording).of(frames)["cam_2"], true > 0


def panel(case: Case, folder: Path) -> Image:
    """Frame and silhouette of a case, with its title."""
    frame, silhouette, true = film(case, folder)
    union = float((silhouette & true).sum() / (silhouette | true).sum())
    print(f"{case.title}: intersection over union {union:.2f}")
    picture = np.full_like(frame, 30)
    picture[silhouette & true] = 255
    picture[silhouette & ~true], picture[true & ~silhouette] = _TOO_MUCH, _MISSING
    width = frame[_CROP].shape[1]
    head, foot = blank(width, 34), blank(width, 30)
    centred(head, case.title, width / 2, 24, 19, INK, bold=True)
    centred(foot, case.remark, width / 2, 20, 12, QUIET)
    return np.concatenate([head, frame[_CROP], picture[_CROP], foot])


def main() -> None:
    """Writes the picture."""
    with tempfile.TemporaryDirectory() as folder:
        panels = [panel(case, Path(folder) / str(k)) for k, case in enumerate(CASES)]
    gap = np.full((panels[0].shape[0], 8, 3), 255, np.uint8)
    row = [image for one in panels for image in (one, gap)][:-1]
    save(np.concatenate(row, axis=1), "silhouette_quality.jpg")


if __name__ == "__main__":
    main()
