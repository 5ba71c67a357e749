"""The page beside the viewer: how the silhouettes of a recording came about, and what a fit made of
them, with the pixel under the mouse explained.
"""

import base64
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from calib.errors import InputError
from silhouette_core.estimator import Frame
from silhouette_core.image.foreground import SilhouetteStages
from voxelpose.view.images.canvas import encoded
from voxelpose.view.serving import page_answers
from voxelpose.view.viewer import previews
from voxelpose.view.viewer.fit_silhouettes import FitSilhouette, FitSilhouettes
from voxelpose.view.viewer.result_scenes import ResultScenes

FOLDER = "silhouettes"
"""Of the server, in which the page is."""
_PLAIN, _CUT = False, True


class SilhouettePage:
    """Shows the silhouettes of scenes.

    Attributes:
        answers: to requests of the page.
    """

    def __init__(self, scenes: ResultScenes) -> None:
        """Reads nothing yet.

        Args:
            scenes: of a result, or of a recording; one must be there.

        Raises:
            InputError: the recording is missing.
        """
        if scenes.recording is None:
            raise InputError(scenes.missing)
        self._scenes, self._recording = scenes, scenes.recording
        self._moments = previews.MomentFrames(self._recording)
        self._fit = FitSilhouettes(scenes)
        self._models = previews.BackgroundModels(self._fit.model)
        self._working = threading.Lock()
        self._fitted: tuple[int, Mapping[str, FitSilhouette]] | None = None  # of the last moment
        self._staged: tuple[tuple[str, int], SilhouetteStages] | None = None  # asked last
        self.answers = page_answers.PageAnswers(
            "voxelpose.view.viewer", self._got, self._posted, FOLDER
        )

    def link(self, frame: int) -> str:
        """HTML that opens the page at a frame."""
        style = "display:block;padding:0 0.8em 0.6em;font-size:0.85em"
        return (
            f'<a href="/{FOLDER}/?frame={frame}" target="{FOLDER}" style="{style}">Why is a pixel'
            " the person? Silhouettes step by step</a>"
        )

    def _got(self, path: Sequence[str], query: Mapping[str, str]) -> page_answers.Content | None:
        match path:
            case ("api", "state"):
                return page_answers.json_content(self._state())
            case ("picture", camera):
                page_answers.check_camera_names([camera], self._recording.rig.names)
                picture = self._frames(page_answers.moment_of(query) or 0)[camera]
                return encoded(picture, ".jpg", 93), "image/jpeg"
        return None

    def _posted(self, path: Sequence[str], body: bytes) -> page_answers.Content | None:
        if tuple(path) != ("api", "stage"):
            return None
        asked = page_answers.parse_request(body, previews.StageAsked)
        page_answers.check_camera_names([asked.camera], self._recording.rig.names)
        with self._working:
            return page_answers.json_content(self._stage(asked))

    def _state(self) -> dict[str, Any]:
        """What the page shows at first."""
        recording = self._recording
        return {
            "name": self._scenes.name,
            "folder": self._scenes.title,
            "moments": recording.frame_count,
            "numbers": recording.numbers.tolist(),
            "fps": recording.fps,
            "masks_only": recording.silhouettes_given,
            "paper": self._scenes.background == "paper",
            "fitted": self._scenes.motion is not None,
            "cameras": [{"name": each.name, "size": list(each.size)} for each in recording.rig],
        }

    def _frames(self, moment: int) -> dict[str, Frame]:
        """Frames of a moment, from 0, by camera name, put in step as by the fit."""
        last = self._recording.frame_count - 1
        late = self._fit.late
        if not 0 <= moment <= last:
            raise InputError(f"there is no moment {moment}: choose one from 0 to {last}")
        return {
            name: self._moments.frames(min(max(moment + late[name], 0), last))[name]
            for name in self._recording.rig.names
        }

    def _stage(self, asked: previews.StageAsked) -> dict[str, Any]:
        """A stage's picture, and a pixel explained, or that backgrounds are still learned."""
        body = asked.stage == "body"
        kinds = (_PLAIN, _CUT) if body and self._fit.cut else (_PLAIN,)
        models = [model for kind in kinds if (model := self._models.get(kind)) is not None]
        if len(models) < len(kinds):
            return {"ready": False}
        frames, answer = self._frames(asked.moment), {"ready": True}
        if not self._recording.silhouettes_given:
            key = asked.camera, asked.moment
            if self._staged is None or self._staged[0] != key:
                self._staged = key, models[0].stages(asked.camera, frames[asked.camera])
            alone = previews.StageAsked(
                asked.moment, asked.camera, None if body else asked.stage, asked.pixel
            )
            size = self._recording.rig[asked.camera].size
            answer = previews.stage_answer(self._staged[1], alone, size)
        if not body:
            return answer
        if self._fitted is None or self._fitted[0] != asked.moment:
            self._fitted = asked.moment, self._fit.of(asked.moment, frames, *models)
        return answer | self._changed(asked, answer)

    def _changed(self, asked: previews.StageAsked, alone: Mapping[str, Any]) -> dict[str, Any]:
        """What the fit made of a silhouette, or of a pixel of it that is explained already."""
        fitted = None if self._fitted is None else self._fitted[1].get(asked.camera)
        if fitted is None:
            raise InputError("nothing is fitted yet: `voxelpose fit` makes a result")
        if asked.pixel is not None and "explained" in alone:
            size = self._recording.rig[asked.camera].size
            at = previews.pixel_at(asked.pixel, size, fitted.alone.shape)
            return {"explained": fitted.explained(alone["explained"], at)}
        picture = base64.b64encode(fitted.picture()).decode()
        return {"png": picture, "note": fitted.summary()}
