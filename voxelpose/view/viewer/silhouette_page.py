"""The page beside the viewer: how the silhouettes of a recording came about, and what a fit made of
them, with the pixel under the mouse explained.

A result holds no silhouettes. They are made by the code and the settings of the fit: completed by
the other cameras; of one camera, what is no piece of the person is left out.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.estimator import ONE_CAMERA, Frame
from silhouette_core.image.silhouettes import Silhouettes, as_recorded
from silhouette_core.monocular.person import find_person
from voxelpose.multiview.silhouettes.completion import SilhouetteCompletion
from voxelpose.view.images.canvas import encoded, png
from voxelpose.view.images.figure import body_parts
from voxelpose.view.serving import page_answers
from voxelpose.view.viewer import previews
from voxelpose.view.viewer.previews import SILHOUETTE
from voxelpose.view.viewer.result_scenes import ResultScenes

ADDED, REMOVED, OUTLINE = (80, 220, 120), (255, 70, 160), (255, 210, 63)  # RGB

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FitSilhouette:
    """A camera's silhouette before and after the fit, and the body: (h, w) bool, as recorded."""

    alone: Mask  # of the picture alone
    used: Mask  # that the fit used
    body: Mask  # where the fitted body is; empty where it was not found
    reasons: tuple[str, str]  # why something was added, and why it was taken out

    def picture(self) -> bytes:
        """PNG to be laid over the frame: kept, added and taken out, and the body's outline."""
        image = np.zeros((*self.alone.shape, 4), np.uint8)
        image[self.alone & self.used] = (*SILHOUETTE[::-1], 90)
        image[self.used & ~self.alone] = (*ADDED[::-1], 190)
        image[self.alone & ~self.used] = (*REMOVED[::-1], 190)
        outlines, _ = cv2.findContours(
            self.body.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE
        )
        for colour, wider in (((0, 0, 0), 2), (OUTLINE, 0)):  # seen before white and black
            cv2.drawContours(image, outlines, -1, (*colour[::-1], 255), 1 + wider)
        return png(image)

    def explained(self, before: Mapping[str, Any], pixel: tuple[int, int]) -> dict[str, Any]:
        """What a pixel is taken for, and why, after it was explained by the picture alone."""
        alone, used = bool(self.alone[pixel]), bool(self.used[pixel])
        why = before["why"] if alone == used else self.reasons[0 if used else 1]
        measures = [*before["measures"]]
        if self.body.any():
            measures.append(f"{'inside' if self.body[pixel] else 'outside'} the body")
        return {**before, "person": used, "why": why, "measures": measures}

    def summary(self) -> str:
        """How much was added and taken out, and how well the body agrees, in words."""
        most = max(np.count_nonzero(self.alone | self.used), 1)
        changes = self.used & ~self.alone, self.alone & ~self.used
        words = [
            f"{100 * np.count_nonzero(mask) / most:.1f} % {reason}"
            for mask, reason in zip(changes, self.reasons, strict=True)
            if reason
        ]
        if self.body.any():
            common = np.count_nonzero(self.body & self.used)
            agreement = 100 * common / np.count_nonzero(self.body | self.used)
            words.append(f"silhouette and body have {agreement:.0f} % in common")
        return "; ".join(words)


class FitSilhouettes:
    """Silhouettes of a result's recording."""

    def __init__(self, scenes: ResultScenes) -> None:
        self._scenes = scenes
        late_frames = scenes.facts.get("late_frames", {})  # by camera name
        self.late = {name: int(late_frames.get(name, 0)) for name in scenes.rig.names}

    def of(
        self, moment: int, frames: Mapping[str, Frame], plain: Silhouettes
    ) -> dict[str, FitSilhouette]:
        """Silhouettes of a moment, by camera name; empty where nothing is fitted.

        Args:
            moment: from 0, of the frames that belong together.
            frames: (H, W, 3) uint8, BGR, by camera name.
            plain: by the pictures alone.
        """
        if not self._scenes.motions:
            return {}
        alone, bodies = plain.of(frames, step=moment), self._bodies(moment)
        used, reasons = alone, ("", "")
        if self._scenes.estimator == "multiview":
            used, reasons = (
                self._completed(moment, frames, plain, alone),
                ("added: other cameras show it", ""),
            )
        elif self._scenes.estimator in ONE_CAMERA:
            used = {name: self._person(name, mask, bodies[name]) for name, mask in alone.items()}
            reasons = "", "taken out: no piece of the person"
        return {
            name: FitSilhouette(mask, used[name], bodies[name], reasons)
            for name, mask in alone.items()
        }

    def _bodies(self, moment: int) -> dict[str, Mask]:
        """Everybody's fitted body (h, w) bool by camera name, as recorded."""
        scenes = self._scenes
        number = int(scenes.recording.numbers[moment]) if scenes.recording else 0
        pairs = list(zip(scenes.motions, scenes.bodies(number), strict=True))
        return {
            camera.name: self._as_recorded(
                camera.name,
                np.logical_or.reduce(
                    [
                        body_parts(motion.model, body.vertices_m, camera) > 0
                        for motion, body in pairs
                        if body is not None
                    ]
                    or [np.zeros(camera.size[::-1], np.bool_)]
                ),
            )
            for camera in scenes.views.rig
        }

    def _completed(
        self,
        moment: int,
        frames: Mapping[str, Frame],
        plain: Silhouettes,
        alone: Mapping[str, Mask],
    ) -> dict[str, Mask]:
        """Silhouettes completed by what the cameras see together."""
        scenes = self._scenes
        soft = plain.soft(frames, moment)
        silhouettes, tint = (
            scenes.views.without_unknown(
                [scenes.lenses[k].undistort(getattr(levels, kind)) for k, levels in soft.items()]
            )
            for kind in ("silhouette", "tint")
        )
        work = SilhouetteCompletion(scenes.views, scenes.volume([]), scenes.rule)
        completed = work.complete(silhouettes, tint)
        cameras = zip(soft, completed, silhouettes, strict=True)
        return {k: alone[k] | self._as_recorded(k, new & ~old) for k, new, old in cameras}

    def _person(self, name: str, mask: Mask, body: Mask) -> Mask:
        """The pieces of one person, who is where the body is."""
        seen, body = (self._scenes.lenses[name].undistort(image) for image in (mask, body))
        near_px = usual_px = None
        if body.any():
            near_px, usual_px = np.argwhere(body).mean(axis=0)[::-1], float(np.count_nonzero(body))
        person = find_person(seen, near_px, usual_px)
        if person is None:
            return np.zeros_like(mask)
        return mask & ~self._as_recorded(name, seen & ~person.mask)

    def _as_recorded(self, name: str, mask: Mask) -> Mask:
        """A mask (h, w) bool of a pinhole camera as its lens shows it."""
        return as_recorded(mask.astype(np.float32), self._scenes.rig[name]) > 0.5


class SilhouettePage:
    """Shows the silhouettes of scenes; its `answers` are to requests of the page."""

    def __init__(self, scenes: ResultScenes) -> None:
        """Reads nothing yet of scenes of a result, or of a recording; InputError where that is
        missing.
        """
        if scenes.recording is None or (reader := scenes.reader) is None:
            raise InputError(scenes.missing)
        self._scenes, self._recording, self._reader = scenes, scenes.recording, reader
        self._moments = previews.MomentFrames(self._recording)
        self._fit = FitSilhouettes(scenes)
        self._models = previews.BackgroundModels(lambda _: reader.silhouettes)
        self._working = threading.Lock()
        self._explorer = previews.StageExplorer(
            self._recording.rig, self._frames, lambda _: self._models.get("plain")
        )
        self._fitted = lru_cache(1)(self._make_fitted)
        self.answers = page_answers.PageAnswers(
            "voxelpose.view.viewer",
            {"api/state": self.state, "picture/{camera}": self._picture},
            {"api/stage": self.stage},
        )

    def state(self) -> dict[str, Any]:
        """All that the page shows at first."""
        recording = self._recording
        return {
            "name": self._scenes.name,
            "folder": self._scenes.title,
            "moments": recording.frame_count,
            "numbers": recording.numbers.tolist(),
            "fps": recording.fps,
            "masks_only": recording.silhouettes_given,
            "paper": self._scenes.background == "paper",
            "fitted": bool(self._scenes.motions),
            "cameras": [{"name": each.name, "size": list(each.size)} for each in recording.rig],
        }

    def _picture(self, camera: str, moment: page_answers.Moment = 0) -> bytes:
        page_answers.check_camera_names([camera], self._recording.rig.names)
        return encoded(self._frames(moment)[camera], ".jpg", 93)

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

    def stage(self, asked: previews.StageAsked) -> dict[str, Any]:
        """See `StageExplorer.answer`, and what the fit made of a silhouette. InputError where
        nothing is fitted, too.
        """
        page_answers.check_camera_names([asked.camera], self._recording.rig.names)
        body, answer = asked.stage == "body", {"ready": True}
        with self._working:
            if self._models.get("plain") is None:
                return {"ready": False}
            if not self._recording.silhouettes_given:
                alone = msgspec.structs.replace(asked, stage=None) if body else asked
                answer = self._explorer.answer(alone)
            return answer | self._changed(asked, answer) if body else answer

    def _make_fitted(self, moment: int) -> Mapping[str, FitSilhouette]:
        return self._fit.of(moment, self._frames(moment), self._reader.silhouettes)

    def _changed(self, asked: previews.StageAsked, alone: Mapping[str, Any]) -> dict[str, Any]:
        """What the fit made of a silhouette, or of a pixel of it that is explained already."""
        fitted = self._fitted(asked.moment).get(asked.camera)
        if fitted is None:
            raise InputError("nothing is fitted yet: `voxelpose fit` makes a result")
        if asked.pixel is not None and "explained" in alone:
            size = self._recording.rig[asked.camera].size
            pixel = previews.pixel_at(asked.pixel, size, fitted.alone.shape)
            return {"explained": fitted.explained(alone["explained"], pixel)}
        return {"png": fitted.picture(), "note": fitted.summary()}
