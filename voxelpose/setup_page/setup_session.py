"""What the page shows and saves of one recording folder."""

import hashlib
import threading
from typing import Any

import numpy as np
from msgspec import UNSET

from calib.errors import InputError
from calib.storage.documents import visible_entries
from calib.upright import UprightFrame, axis_name, direction_of
from silhouette_core.estimator import BackgroundKind, Settings
from silhouette_core.image.seen_people import people_looked_for
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.progress import SilentReporter
from voxelpose.cli.options import folder_settings
from voxelpose.multiview.silhouettes.prepared_silhouettes import LONG_SIDE_PX
from voxelpose.recording.subject import SETTINGS_FILE
from voxelpose.recording.unknown_places import RECORDING_FILE
from voxelpose.setup_page import page_requests
from voxelpose.setup_page.check_findings import find_disagreement, repair_folder, replaced_inputs
from voxelpose.setup_page.clicked_points import (
    POINTS_FILE,
    check_points,
    ground_lines,
    point_errors,
    read_clicked,
    save_clicked,
    up_choices,
)
from voxelpose.setup_page.drawn_places import (
    CHOICES,
    DrawnRecording,
    PlaceFiles,
    change_section,
    check_choices,
    setting_ranges,
)
from voxelpose.setup_page.opened_folder import OpenedFolder
from voxelpose.view.images.canvas import encoded
from voxelpose.view.serving.gate import Address, GatedServer
from voxelpose.view.serving.page_answers import Moment, PageAnswers, check_camera_names
from voxelpose.view.serving.page_job import PageJob
from voxelpose.view.viewer import previews

_REGION, _UNKNOWN = (80, 200, 120), (255, 150, 40)
_MEANWHILE = (
    "another page or program has changed this folder's files since this page was loaded: load it"
    " again to see them, or save once more, and what is here counts"
)


class _Notes(SilentReporter):
    words = ""

    def note(self, text: str) -> None:
        self.words = text


class SetupSession:
    """A recording folder behind the page; its `answers` are to requests of it."""

    def __init__(
        self, opened: OpenedFolder, job: PageJob | None = None, studio: str | None = None
    ) -> None:
        """Reads what the folder holds besides pictures. Checks are run by `job`, the studio's,
        whose page is at the address `studio`; None: it is set up alone. InputError where a file of
        the folder is damaged.
        """
        self._job, self._owns_job, self._studio = job or PageJob(), job is None, studio
        self.folder = opened.recording.folder
        self._name = self.folder.resolve().name
        self._staging = threading.Lock()
        self._saving = threading.Lock()
        self._open(opened)
        read_clicked(self.folder / POINTS_FILE)
        self.answers = PageAnswers(
            "voxelpose.setup_page",
            {
                "api/state": self.state,
                "events": self._job.events,
                "picture/{camera}": self.picture,
                "painted/{kind}/{camera}": self.painted,
            },
            {
                "api/silhouettes": self.silhouettes,
                "api/stage": self.stage,
                "api/points": self.errors,
                "api/ground": self.ground,
                "api/save": self.save,
                "api/check/start": self.start_check,
                "api/check/repair": self.repair,
                "api/stop": self._job.stop,
            },
        )

    def _open(self, opened: OpenedFolder) -> None:
        self._opened = opened
        self._recording = opened.recording
        self._places = PlaceFiles.read(self._recording)
        self._moments = previews.MomentFrames(self._recording)
        self._backgrounds = previews.BackgroundModels(self._learn_silhouettes)
        self._explorer = previews.StageExplorer(
            self._recording.rig, self._moments.frames, self._model
        )
        self._notes = _Notes()

    def close(self) -> None:
        """Ends what is running, but for the studio's job."""
        if self._owns_job:
            self._job.close()

    def state(self) -> dict[str, Any]:
        """All that the page shows at first, and after saving. InputError where a file was damaged
        meanwhile.
        """
        recording = self._recording
        with self._saving:
            places = self._places
        empty, many = self._moments.empty(), recording.frame_count > 20_000
        return {
            "seen": self._files_digest(),
            "folder": str(self.folder),
            "name": self._name,
            "studio": self._studio,
            "moments": recording.frame_count,
            "numbers": None if many else recording.numbers.tolist(),
            "times_s": None if many else recording.times_s.tolist(),
            "masks_only": recording.silhouettes_given,
            "cameras": [
                {
                    "name": camera.name,
                    "size": list(camera.size),
                    "empty": camera.name in empty,
                    "painted_region": camera.name in places.regions
                    and places.regions[camera.name].painted,
                    "painted_unknown": camera.name in places.painted,
                }
                for camera in recording.rig
            ],
            "regions": {name: file.polygons for name, file in places.regions.items()},
            "unknown": places.polygons,
            "points": read_clicked(self.folder / POINTS_FILE),
            "settings": {
                name: {"value": value, "file": file}
                for name, (value, file) in folder_settings("fit", self.folder).items()
                if name in CHOICES
            },
            "ranges": setting_ranges(),
            "own_settings": str((self.folder / SETTINGS_FILE).resolve()),
            "refused": self._refusals(),
            "fault": self._opened.fault,
            "up": self._up() if self._opened.calibrated else None,
        }

    def picture(self, camera: str, moment: Moment | None = None) -> bytes:
        """A frame as JPEG; of the empty view where no moment is given. InputError where there is
        none.
        """
        frames = self._moments.empty() if moment is None else self._moments.frames(moment)
        check_camera_names([camera], self._recording.rig.names)
        if camera not in frames:
            raise InputError(f"there is no picture of the empty view of {camera}")
        return encoded(frames[camera], ".jpg", 93)

    def painted(self, camera: str, kind: str) -> bytes:
        """What is painted in regions/ or unknown/, as PNG to be laid over the picture. InputError
        where nothing is.
        """
        file, mask = self._places.regions.get(camera), self._places.painted.get(camera)
        if kind == "region" and file is not None:
            return previews.overlay_png(file.mask, _REGION, 0)
        if kind == "unknown" and mask is not None:
            return previews.overlay_png(mask, _UNKNOWN, 110)
        raise InputError("nothing is painted there")

    def silhouettes(self, asked: page_requests.SilhouetteRequest) -> dict[str, Any]:
        """Silhouettes of a moment: `ready` with a PNG by camera, or not yet. InputError where there
        is no such moment or camera, or files cannot be read.
        """
        frames = self._moments.frames(asked.moment)
        model = self._model(asked)
        if model is None:
            return {"ready": False}
        with self._staging:  # the pose network looks at one moment after the other
            masks = model.of(frames, step=asked.moment)
        return {
            "ready": True,
            "guessed": list(model.without_background),
            "note": self._notes.words,
            "cameras": {
                name: {
                    "png": previews.overlay_png(mask, previews.SILHOUETTE, 120),
                    "share": float(np.mean(mask)),
                }
                for name, mask in masks.items()
            },
        }

    def stage(self, asked: page_requests.StageRequest) -> dict[str, Any]:
        """A stage of a camera's silhouette: `ready` with a picture, and a pixel explained; or not
        yet. InputError where there is no such moment, camera or stage, or files cannot be read.
        """
        with self._staging:
            return self._explorer.answer(asked)

    def _model(
        self, asked: page_requests.SilhouetteRequest | page_requests.StageRequest
    ) -> Silhouettes | None:
        """Silhouettes with what is drawn; None while their backgrounds are learned. InputError
        where there is no such camera, or files cannot be read.
        """
        self._check_places(asked.places)
        model = self._backgrounds.get(asked.background)
        if model is None:
            return None
        source = DrawnRecording(
            **vars(self._recording),
            drawn_regions=self._places.region_masks(asked.places),
            drawn_unknown=self._places.unknown_masks(asked.places),
        )
        return model.with_places(source)

    def _learn_silhouettes(self, kind: BackgroundKind) -> Silhouettes:
        source = DrawnRecording(**vars(self._recording))
        use, _ = folder_settings("fit", self.folder).get("network", ("auto", ""))
        settings = Settings(background=kind, network=use)
        people = people_looked_for(source, settings, self._notes)
        return Silhouettes(source, kind, LONG_SIDE_PX, people=people)

    def errors(self, points: page_requests.Points) -> dict[str, Any]:
        """How far the clicks are from where the calibration puts the points. InputError where there
        is no calibration, or two points have the same name.
        """
        self._require("points")
        check_points(points)
        return point_errors(points, self._recording.rig)

    def ground(
        self, up: page_requests.Up | None = None, height_m: page_requests.Metre = 0.0
    ) -> dict[str, Any]:
        """Lines by camera of the floor at a height, m, along up; None: as it is found. InputError
        where there is no calibration, or up is no direction.
        """
        self._require("floor")
        frame = self._recording.upright_frame(None if up is None else direction_of(up))
        frame = UprightFrame(frame.rotation, height_m)
        return {"up": axis_name(frame.up), "cameras": ground_lines(self._recording.rig, frame)}

    def start_check(self) -> None:
        """Begins the check of the cameras. InputError where it is not possible."""
        self._require("check")
        self._job.start("check", self._name, find_disagreement, self._recording)

    def check_status(self) -> dict[str, Any]:
        """How far the check of this folder is, or what it found; see `PageJob.status`."""
        return self._job.status("check", self._name)

    def repair(self) -> dict[str, Any]:
        """Writes the files that the check has repaired, keeps those before, and opens the folder
        again; returns the files. InputError where nothing can be repaired, files have changed since
        the check, or the system refuses.
        """
        status = self.check_status()
        repaired = status.get("repaired")
        if not repaired:
            raise InputError("there is nothing to repair: check the cameras first")
        if status["inputs"] != replaced_inputs(self._recording):
            raise InputError("calibration or time stamps have changed since: check again")
        with self._saving, self._staging:
            written = repair_folder(self.folder, repaired)
            change_section(self.folder / SETTINGS_FILE, "fit", {"unit": None})  # stated now
            opened = self._opened
            self._open(OpenedFolder.open(self.folder, None, opened.fps, opened.label))
        self._job.stop(status["number"])
        return {"written": [path.name for path in written]}

    def save(self, asked: page_requests.SaveRequest) -> dict[str, Any]:
        """Writes what is asked for, all of which is checked before; returns the files, what is left
        out, and the new state; or, where files are not as they were shown, a line about it as
        `meanwhile`, and writes nothing. InputError where a value makes no sense, or a file cannot
        be written.
        """
        folder = self.folder
        self._check_places(asked.places)
        check_choices(asked.fit, self._recording.rig.names)
        if asked.points is not UNSET:
            check_points(asked.points)
        left_out: list[str] = []
        with self._saving:
            if asked.seen and asked.seen != self._files_digest():
                return {"meanwhile": _MEANWHILE}
            written, removed = self._places.save(folder, asked.places)
            if asked.points is not UNSET and (asked.points or (folder / POINTS_FILE).exists()):
                left_out = save_clicked(folder / POINTS_FILE, asked.points)
                written.append(folder / POINTS_FILE)
            if change_section(folder / SETTINGS_FILE, "fit", asked.fit):
                written.append(folder / SETTINGS_FILE)
            self._places = PlaceFiles.read(self._recording)
        return {
            "written": [str(path.relative_to(folder)) for path in written],
            "removed": [str(path.relative_to(folder)) for path in removed],
            "left_out": left_out,
            "state": self.state(),
        }

    def _files_digest(self) -> str:
        names = POINTS_FILE, SETTINGS_FILE, RECORDING_FILE
        files = [self.folder / name for name in names]
        files += visible_entries(self.folder / "regions")
        digest = hashlib.sha256()
        for file in files:
            if file.is_file():
                digest.update(f"{file.name}\0{file.stat().st_size}\0".encode())
                digest.update(file.read_bytes())
        return digest.hexdigest()

    def _check_places(self, places: page_requests.PlacesDrawn) -> None:
        check_camera_names((*places.regions, *places.unknown), self._recording.rig.names)

    def _require(self, part: str) -> None:
        refusal = self._refusals().get(part)
        if refusal is not None:
            raise InputError(refusal)

    def _refusals(self) -> dict[str, str]:
        """What this folder cannot have, and why."""
        refused = {}
        if not self._opened.calibrated:
            reason = self._opened.fault or "there is no calibration"
            refused["points"] = refused["floor"] = refused["check"] = reason
        elif self._opened.fault:
            refused["check"] = self._opened.fault
        elif len(self._recording.rig) < 2:
            refused["check"] = "one camera cannot disagree with another: this needs two or more"
        if self._recording.silhouettes_given:
            refused["background"] = "masks/ holds silhouettes: they are used as they are"
        return refused

    def _up(self) -> dict[str, Any]:
        """Up without a setting, where it is from, and what else it may be."""
        stated = self._recording.up is not None
        return {
            "found": axis_name(self._recording.upright_frame().up),
            "source": "the calibration's [metadata]" if stated else "how the cameras stand",
            "choices": up_choices(self._recording.rig),
        }


class SetupServer(GatedServer):
    """Serves a session's page until it is closed, and the session with it."""

    def __init__(self, session: SetupSession, address: Address) -> None:
        """Starts, in a thread of its own. InputError where the address cannot be used."""
        self.session = session
        super().__init__(address, session.answers.answer, session.close, page_requests.LARGEST_BODY)
