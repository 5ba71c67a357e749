"""The viewer in the browser: viser's panel over `ResultScenes`.

Callbacks only record the choice; one thread draws it.
"""

import threading
import time
from dataclasses import replace

import numpy as np

from calib.errors import InputError
from voxelpose.people_marks import person_names
from voxelpose.view.serving.gate import Address
from voxelpose.view.serving.page_server import PageServer
from voxelpose.view.viewer.legend import area_text, display_name, legend_html, text_html
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.scene import LAYERS, PICTURES, Choice, SceneRenderer, frame_html
from voxelpose.view.viewer.silhouette_page import SilhouettePage

_NO_PART = "none"


class Browser:
    """Serves scenes to browsers."""

    def __init__(self, scenes: ResultScenes, address: Address | None, frame: int) -> None:
        """Starts the server; nothing is drawn before the first `step`, which shows a frame. The
        scenes are closed with it. Without an address it is a part of other pages, which pass
        requests on to `answer`. InputError where the address cannot be used.
        """
        self.scenes = scenes
        count = len(scenes.motions)
        self._people = person_names(count) if count > 1 else []
        self.choice = Choice(
            int(np.flatnonzero(scenes.frames == frame)[0]),
            shown=frozenset({*LAYERS, *self._people}),
        )
        self._drawn: Choice | None = None
        self._wake = threading.Event()
        self._wake.set()
        self._played_s = 0.0
        self._silhouettes = None if scenes.recording is None else SilhouettePage(scenes)
        beside = None if self._silhouettes is None else self._silhouettes.answers
        self._page = PageServer(address, f"{scenes.name} – voxelpose view", beside)
        self.server, self.url, self.answer = self._page.viser, self._page.url, self._page.answer
        models = [motion.model for motion in scenes.motions]
        self._renderer = SceneRenderer(self.server.scene, scenes.voxel_size_m, models)
        self._make_panel()
        self._set_up_view()

    def run(self) -> None:
        """Draws what is chosen until the process is interrupted."""
        while True:
            self.step(0.5)

    def step(self, timeout_s: float) -> bool:
        """Waits for a choice, at most so long, or the next frame while playing; whether it drew."""
        if self._play.value:
            self._advance()
        elif not self._wake.wait(timeout_s):
            return False
        self._wake.clear()
        choice = self.choice
        if choice == self._drawn:
            return False
        frame = int(self.scenes.frames[choice.row])
        try:
            scene = self.scenes.scene(frame)
            areas = self.scenes.areas(frame) if choice.part else {}
        except InputError as error:  # for example a truncated video: other frames may be readable
            self._status.content, self._drawn = text_html([f"Frame {frame}", f"⚠ {error}"]), choice
            return True
        with self.server.atomic():
            self._renderer.draw(scene, areas, choice)
            self._status.content = frame_html(scene)
            if self._silhouettes is not None:
                self._link.content = self._silhouettes.link(frame)
            self._area.content = area_text(choice.part, areas)
        self._drawn = choice
        return True

    def close(self) -> None:
        """Stops the server."""
        self._page.close()
        self.scenes.close()

    def _choose(self, **changes: object) -> None:
        self.choice = replace(self.choice, **changes)  # type: ignore[arg-type]
        self._wake.set()

    def _advance(self) -> None:
        """Advances by the time since the last frame: slow drawing skips frames."""
        period = 1 / (self.scenes.fps * float(self._speed.value))
        time.sleep(max(0.0, self._played_s + period - time.monotonic()))
        due = max(1, int((time.monotonic() - self._played_s) / period))
        self._played_s = time.monotonic()
        row = (self.choice.row + due) % len(self.scenes.frames)
        self._slider.value = int(self.scenes.frames[row])
        self._choose(row=row)

    def _start(self) -> None:
        self._played_s = time.monotonic()
        self._wake.set()

    def _make_panel(self) -> None:
        gui, frames, fitted = self.server.gui, self.scenes.frames, bool(self.scenes.motions)
        first, last = int(frames[0]), int(frames[-1])
        shown, single = int(frames[self.choice.row]), last == first
        with gui.add_folder("Time"):
            self._slider = gui.add_slider(
                "Frame", first, max(last, first + 1), 1, shown, disabled=single
            )
            self._play = gui.add_checkbox("Play", False, disabled=single)
            self._speed = gui.add_slider("Speed", 0.1, 2.0, 0.1, 1.0)
        self._slider.on_update(
            lambda _: self._choose(row=min(int(self._slider.value), last) - first)
        )
        self._play.on_update(lambda _: self._start())
        with gui.add_folder("This frame"):
            self._status = gui.add_html(text_html(["Reading the recording …"]))
            self._link = gui.add_html("", visible=self._silhouettes is not None)
        with gui.add_folder("Show"):
            pictures = gui.add_dropdown("Cameras show", PICTURES)
            pictures.on_update(lambda _: self._choose(pictures=pictures.value))
            for name, label in LAYERS.items():
                available = fitted or name in ("cameras", "hull")
                if name == "hypotheses":
                    available = self.scenes.has_hypotheses
                self._add_layer(name, label, available)
            for name in self._people:
                self._add_layer(name, display_name(name).capitalize(), available=True)
        parts = {display_name(name): name for name in self.scenes.limb_names}
        with gui.add_folder("Where could a part be?", visible=bool(parts)):
            part = gui.add_dropdown("Part", (_NO_PART, *parts))
            part.on_update(lambda _: self._choose(part=parts.get(part.value)))
            self._area = gui.add_markdown(area_text(None, {}))
        with gui.add_folder("Colours"):
            gui.add_html(legend_html(self.scenes.has_hypotheses, len(self._people)))

    def _add_layer(self, name: str, label: str, available: bool) -> None:
        box = self.server.gui.add_checkbox(label, True, visible=available)

        def choose(_: object) -> None:
            shown = self.choice.shown
            self._choose(shown=shown | {name} if box.value else shown - {name})

        box.on_update(choose)

    def _set_up_view(self) -> None:
        """Adds lights and a floor, and puts the viewpoint beside the first camera."""
        motions = self.scenes.motions
        centers = np.array([camera.center_m for camera in self.scenes.rig])
        if not motions:
            middle, floor, size = centers.mean(0) * (1, 1, 0) + (0, 0, 1), 0.0, 1.0
        else:
            roots = np.concatenate([motion.root_m for motion in motions])
            middle, motion = np.median(roots, axis=0), motions[0]
            person = motion.model.person
            # Hips are at 0.54 of the stature.
            floor = motion.floor_m if person is None else middle[2] - 0.54 * person.stature_m
            # A person of 1.75 m is seen from 3.2 m, other bodies from as many times their extent.
            floor, size = float(floor), motion.model.extent_m / 1.75
            size += 0.4 * float(np.ptp(roots[:, :2], axis=0).max()) if self._people else 0.0
        self.server.scene.set_up_direction("+z")
        # Reflections and shadows cost more than they show.
        self.server.scene.configure_default_lights(cast_shadow=False)
        self.server.scene.configure_environment_map(None)
        self.server.scene.add_light_ambient("/light", intensity=1.5)
        self.server.scene.add_grid(
            "/floor", 8.0, 8.0, position=(float(middle[0]), float(middle[1]), floor), cell_size=0.5
        )
        toward = centers[0] - middle
        beside = np.array([toward[0] - 0.4 * toward[1], toward[1] + 0.4 * toward[0], 0.0])
        beside *= 3.2 * size / max(float(np.linalg.norm(beside)), 1e-9)
        self.server.initial_camera.look_at = middle
        self.server.initial_camera.position = middle + beside + (0, 0, 0.9 * size)
