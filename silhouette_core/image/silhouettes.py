"""Silhouettes of a recording's frames, and their undistortion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from math import gcd
from typing import get_args

import cv2
import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, ByteArray, Float32Array, IntArray
from calib.errors import InputError
from calib.moments import even_moments
from silhouette_core.estimator import BackgroundKind, Frame, FrameSource
from silhouette_core.image.background import BackgroundModel, Method
from silhouette_core.image.camera_motion import CameraMovement
from silhouette_core.image.cast_shadow import darkest_shadow
from silhouette_core.image.cut import cut_size
from silhouette_core.image.empty_scene import Kind
from silhouette_core.image.exposure import Exposure
from silhouette_core.image.foreground import SilhouetteStages, SoftSilhouette
from silhouette_core.image.seen_joints import SeenJoints, joints_of_silhouette
from silhouette_core.image.seen_people import People, people_masks, people_odds
from silhouette_core.network_files import POSE_NETWORK
from silhouette_core.progress import Reporter
from silhouette_core.read_ahead import side_by_side

Window = tuple[slice, slice]
EMPTY_VIEW, UNIFORM = "an empty view", "a uniform backdrop"
ESTIMATED = "estimated from the recording's own frames"

_BACKGROUND_FRAMES = 120
_OCCUPIED, _SEEN = 40, 16  # frames that are looked at beforehand without an empty view, and with


class Silhouettes:
    """Background subtraction for all cameras of a recording.

    Attributes:
        kinds: By camera name, what its background is taken from: `EMPTY_VIEW`, `UNIFORM` or
            `ESTIMATED`; empty where silhouettes are given.
        moving: Cameras that move while they film, as far as that can be seen.
        people: whom the pose network sees; None: it is not asked.
        unknown: (h, w) bool by camera name, of the silhouettes' size, where nothing is known;
            silhouettes are empty there.
    """

    def __init__(
        self,
        source: FrameSource,
        background: BackgroundKind = "auto",
        long_side_px: int | None = None,
        *,
        ahead: bool = True,
        people: People | None = None,
    ) -> None:
        """Builds the background models of a recording. Raises InputError where a background cannot
        be read, or differs in size from its camera's image, or there is no such kind.

        Args:
            source: The recording.
            background: See `BackgroundKind`.
            long_side_px: Size of the longer side to which larger frames, and with them their
                silhouettes, are scaled down; None keeps all sizes.
            ahead: Whether the recording's own frames may be read beforehand, which tell how dark
                cast shadows are, and the person's colours. Cameras without frames of the empty
                scene need them anyway.
            people: Whom the pose network sees. None: it is not asked.
        """
        if background not in get_args(BackgroundKind):
            kinds = ", ".join(get_args(BackgroundKind))
            raise InputError(f"background = {str(background)[:40]!r} must be one of {kinds}")
        self._sizes = {camera.name: scaled_size(camera, long_side_px) for camera in source.rig}
        self._cameras = {camera.name: camera for camera in source.rig}
        method: Method = "paper" if background == "paper" else "refined"
        kind: Kind = "auto" if background == "paper" else background
        self._given, self._refined = source.silhouettes_given, method == "refined"
        self._size_px = long_side_px
        self._read_places(source)
        self._models: dict[str, BackgroundModel] = {}
        self._exposures: dict[str, Exposure] = {}  # of each camera's last whole frame
        self._learning: frozenset[str] = frozenset()  # cameras whose person is not known ahead
        self.people = people
        self.kinds: dict[str, str] = {}
        self.moving: tuple[str, ...] = ()
        self._shaking: dict[str, CameraMovement] = {}
        self._other_settings: tuple[str, ...] = ()  # cameras whose empty view had others
        self._other_tones: tuple[str, ...] = ()  # those of which it is set aside
        if self._given:
            return
        backgrounds = source.backgrounds()
        ahead = ahead and method == "refined"
        seen = self._samples(source, tuple(backgrounds), _SEEN, backgrounds) if ahead else {}
        aside = self._other_tones
        backgrounds = {name: empty for name, empty in backgrounds.items() if name not in aside}
        seen = {name: frames for name, frames in seen.items() if name not in aside}
        without = [name for name in source.rig.names if name not in backgrounds]

        def model(name: str) -> BackgroundModel:
            frames = islice(backgrounds[name], _BACKGROUND_FRAMES)
            empty = (self._registered(name, frame) for frame in frames)
            taken, _ = seen.get(name, ((), None))
            return BackgroundModel.from_frames(empty, method).as_grey(taken, len(self._sizes) > 1)

        self._models = dict(zip(backgrounds, side_by_side(model, list(backgrounds)), strict=True))
        if self._refined:
            self._learning = frozenset(backgrounds) - seen.keys()
        for name, (frames, odds) in self._samples(source, without, _OCCUPIED, backgrounds).items():
            self._models[name] = BackgroundModel.from_occupied(frames, method, odds, kind)
        self.kinds = {
            name: EMPTY_VIEW if name in backgrounds else UNIFORM if known.uniform else ESTIMATED
            for name in source.rig.names
            if (known := self._models.get(name)) is not None
        }
        if ahead:
            self._measure_shadow({name: frames for name, (frames, _) in seen.items()})

            def coloured(name: str) -> BackgroundModel:
                return self._models[name].with_colours(*seen[name])

            self._models |= dict(zip(seen, side_by_side(coloured, list(seen)), strict=True))
        self.moving = tuple(name for name in self.moving if self.kinds[name] != UNIFORM)

    def with_places(self, source: FrameSource) -> Silhouettes:
        """The same background models, with the regions and unknown places of another source.

        Args:
            source: of the same cameras.
        """
        other = copy(self)
        other._exposures = {}
        other._read_places(source)
        return other

    def _read_places(self, source: FrameSource) -> None:
        """Reads the regions, and the unknown places, which are outside of them."""
        self._regions = {
            name: self.scaled(name, region.astype(np.uint8)) > 0
            for name, region in source.regions().items()
        }
        self.unknown = scaled_unknown(source, self._size_px)
        for name, mask in self.unknown.items():
            self._regions[name] = ~mask & self._regions.get(name, True)

    def unknown_of(self, names: Sequence[str]) -> list[BoolArray] | None:
        """Unknown places (h, w) bool of some cameras; None where there are none in any."""
        if not self.unknown:
            return None
        sizes = ((name, self._sizes[name][::-1]) for name in names)
        return [self.unknown.get(name, np.zeros(size, np.bool_)) for name, size in sizes]

    @property
    def without_background(self) -> tuple[str, ...]:
        """Cameras whose empty scene is estimated from a person's movement: it is less sure."""
        return tuple(name for name, kind in self.kinds.items() if kind == ESTIMATED)

    @property
    def network(self) -> str | None:
        """SHA-256 of the pose network that was asked; None: none was."""
        return None if self.people is None else POSE_NETWORK.sha256

    @property
    def by_texture(self) -> dict[str, float | None]:
        """By name of each camera without colour, see `BackgroundModel.by_texture`."""
        return {name: model.by_texture for name, model in self._models.items() if model.grey}

    def note(self, reporter: Reporter) -> None:
        """Tells the kind of each camera's background, and which film without colour."""
        groups = [
            f"{', '.join(name for name in self.kinds if self.kinds[name] == kind)}: {kind}"
            for kind in dict.fromkeys(self.kinds.values())
        ]
        if groups:
            reporter.note("backgrounds: " + "; ".join(groups))
        if self.moving:
            reporter.note(
                f"{', '.join(self.moving)}: moves while it films, and no background can be told:"
                " every camera must stand still, as on a tripod"
            )
        if self._other_settings:
            aside = f", and of {', '.join(self._other_tones)} is not used" * bool(self._other_tones)
            reporter.note(
                f"the empty view of {', '.join(self._other_settings)} was filmed with other"
                f" settings than the take (exposure, white balance, HDR){aside}: film both alike"
            )
        if self._shaking:
            reporter.note(
                f"{', '.join(self._shaking)}: shakes, or was touched: its frames are registered to"
                " where it stands in the mean"
            )
        for several, words in (
            (True, "what is darker counts as the person there, shadows too"),
            (False, "texture tells clothes from shadows there"),
        ):
            grey = [name for name in self.by_texture if self._models[name].several == several]
            if grey:
                reporter.note(f"without colour: {', '.join(grey)}: {words}")

    def of(
        self,
        frames: Mapping[str, Frame],
        near: Mapping[str, Window] | None = None,
        step: int | None = None,
    ) -> dict[str, BoolArray]:
        """Silhouettes (H, W) bool of frames (H, W, 3) uint8, BGR, by camera name.

        Args:
            frames: by camera name.
            near: rows and columns of the silhouettes outside of which nothing is looked for, by
                camera name; for the refined method, in frames that follow on each other. None:
                whole frames.
            step: The number of the frames, by which the pose network is asked.
        """

        self._look(step, frames)

        def silhouette(name: str) -> BoolArray:
            if near is None or self._given:
                return self._known(name, self._silhouette(name, frames[name], step))
            mask = self._silhouette_near(name, frames[name], near.get(name), step)
            return self._known(name, mask)

        return dict(zip(frames, side_by_side(silhouette, list(frames)), strict=True))

    def of_people(self, name: str, step: int) -> list[BoolArray]:
        """Where the pose network sees each of the people in a frame whose silhouette was made, of
        its size; nobody where the network is not asked.
        """
        if self.people is None:
            return []
        size = self._sizes[name]
        return people_masks(self.people.of(name, step), size[0] / self._cameras[name].size[0], size)

    def shows_nobody(self, name: str, step: int) -> bool:
        """Whether an empty silhouette of a frame means that nobody is there: the pose network sees
        nobody, or, where it is not asked, the background is not estimated from the recording, of
        which who stands still is part.
        """
        if self.people is None:
            return name not in self.without_background
        return not self.people.of(name, step)

    def soft(
        self, frames: Mapping[str, Frame], step: int | None = None
    ) -> dict[str, SoftSilhouette]:
        """Soft silhouettes of frames (H, W, 3) uint8, BGR, by camera name; `step` as of `of`."""

        self._look(step, frames)

        def soft_silhouette(name: str) -> SoftSilhouette:
            if self._given:
                return SoftSilhouette.of(self._known(name, self._silhouette(name, frames[name])))
            frame = self._registered(name, frames[name])
            evidence = self._evidence(name, step)
            soft = self._models[name].soft_silhouette(frame, self._regions.get(name), evidence)
            return SoftSilhouette(*(self._known(name, mask) for mask in soft))

        return dict(zip(frames, side_by_side(soft_silhouette, list(frames)), strict=True))

    def stages(self, name: str, frame: Frame, step: int | None = None) -> SilhouetteStages:
        """How the silhouette of a camera's frame (H, W, 3) uint8, BGR, comes about. Raises
        InputError where the silhouettes are given, so that nothing makes them.

        Args:
            name: of the camera.
            frame: as recorded; the stages have the size of its silhouettes.
            step: The number of the frame, by which the pose network is asked.
        """
        if self._given:
            raise InputError("masks/ holds silhouettes: they are used as they are")
        self._look(step, {name: frame})
        frame = self._registered(name, frame)
        evidence = self._evidence(name, step)
        stages = self._models[name].stages(frame, self._regions.get(name), evidence)
        return replace(stages, silhouette=self._known(name, stages.silhouette))

    def _known(self, name: str, mask: BoolArray) -> BoolArray:
        """Mask without what is unknown, where holes may have been filled."""
        return mask & ~self.unknown[name] if name in self.unknown else mask

    def _look(self, step: int | None, frames: Mapping[str, Frame]) -> None:
        """Looks for people in frames that the pose network was not yet asked about."""
        if self.people is not None and step is not None:
            self.people.look(step, frames)

    def _evidence(self, name: str, step: int | None) -> Float32Array | None:
        """What the pose network says of a frame in the size in which it is cut."""
        if step is None or self.people is None:
            return None
        size, seen = cut_size(self._sizes[name]), self.people.of(name, step)
        return people_odds(seen, size[0] / self._cameras[name].size[0], size)

    def joints(self, name: str, step: int, mask: BoolArray) -> SeenJoints | None:
        """Joints that the network sees, in a frame of a camera, of the person with a silhouette
        (h, w) bool; None where it does not.
        """
        if self.people is None:
            return None
        return joints_of_silhouette(self.people.of(name, step), self._cameras[name], mask)

    def _silhouette(self, name: str, frame: Frame, step: int | None = None) -> BoolArray:
        region, frame = self._regions.get(name), self._registered(name, frame)
        if not self._given:
            evidence, model = self._evidence(name, step), self._models[name]
            if name not in self._learning:
                return model.silhouette(frame, region, evidence)
            mask, self._exposures[name] = model.look(frame, region, evidence)
            return mask
        mask = frame.max(axis=2) > 127
        return mask if region is None else mask & region

    def _silhouette_near(
        self, name: str, frame: Frame, near: Window | None, step: int | None
    ) -> BoolArray:
        """Within a window, or of the whole frame, whose exposure is then remembered."""
        region, model = self._regions.get(name), self._models[name]
        exposure = self._exposures.get(name)
        if near is None or exposure is None:
            return self._silhouette(name, frame, step)
        window, part = self._part(name, frame, near)
        return model.silhouette_near(frame, part, window, exposure, region)

    def _part(self, name: str, frame: Frame, near: Window) -> tuple[Window, ByteArray]:
        """A frame in a window of its silhouette, and the window: widened so that its edges are
        edges of the frame's pixels too.
        """
        inside, within = [], []
        for wanted, full, size in zip(near, frame.shape, self._sizes[name][::-1], strict=False):
            count = gcd(full, size)
            first, last = wanted.start * count // size, -(-min(wanted.stop, size) * count // size)
            inside.append(slice(first * size // count, last * size // count))
            within.append(slice(first * full // count, last * full // count))
        part = frame[within[0], within[1]]
        size = tuple(part_of.stop - part_of.start for part_of in inside[::-1])
        if size != part.shape[1::-1]:
            part = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
        return (inside[0], inside[1]), part  # type: ignore[return-value]

    def scaled(self, name: str, image: ByteArray) -> ByteArray:
        """A camera's picture (H, W) or (H, W, 3) uint8 in the size of its silhouettes."""
        if image.shape[1::-1] == self._sizes[name]:
            return image
        return cv2.resize(image, self._sizes[name], interpolation=cv2.INTER_AREA)  # type: ignore[return-value]

    def _registered(self, name: str, image: ByteArray) -> ByteArray:
        """A camera's frame, scaled; of one that shakes, registered where that succeeds."""
        image = self.scaled(name, image)
        return self._shaking[name].registered(image) if name in self._shaking else image

    def _samples(
        self,
        source: FrameSource,
        names: Sequence[str],
        count: int,
        backgrounds: Mapping[str, Iterable[Frame]],
    ) -> dict[str, tuple[list[Frame], list[Float32Array] | None]]:
        """Frames of some cameras, few enough for memory, and the evidence of each. They tell which
        cameras move, and which shake.
        """
        samples: dict[str, list[Frame]] = {name: [] for name in names}
        evidence: dict[str, list[Float32Array]] = {}
        steps = even_moments(source.frame_count, count, margin=0).tolist() if names else []
        for step, frames in zip(steps, source.at(steps), strict=False):
            self._look(step, {name: frames[name] for name in names})
            for name in names:
                samples[name].append(self.scaled(name, frames[name]))
        for name, seen in samples.items():
            empty = [self.scaled(name, one) for one in islice(backgrounds.get(name, ()), 1)]
            motion = CameraMovement(seen, empty)
            self.moving += (name,) if motion.moves else ()
            self._shaking |= {name: motion} if motion.shakes else {}
            self._other_settings += (name,) if motion.other_settings else ()
            self._other_tones += (name,) if motion.other_tones else ()
            samples[name] = [self._registered(name, frame) for frame in seen]
            odds = [self._evidence(name, step) for step in steps[: len(seen)]]
            evidence[name] = [one for one in odds if one is not None]
        return {name: (samples[name], evidence[name] or None) for name in evidence}

    def _measure_shadow(self, samples: Mapping[str, Sequence[Frame]]) -> None:
        """Measures the darkest cast shadow of cameras together: they see the same light."""

        def counts(name: str) -> IntArray:
            return np.sum([self._models[name].shadow_counts(one) for one in samples[name]], axis=0)

        histograms = side_by_side(counts, list(samples))
        darkest = darkest_shadow(np.sum(histograms, axis=0)) if histograms else None
        if darkest is not None:
            self._models |= {name: self._models[name].with_shadow(darkest) for name in samples}


def scaled_unknown(source: FrameSource, long_side_px: int | None) -> dict[str, BoolArray]:
    """Unknown places (h, w) bool of a recording by camera name, of its silhouettes' size; pixels
    that are so in part included.
    """
    scaled = {}
    for name, mask in source.unknown().items():
        size = scaled_size(source.rig[name], long_side_px)
        image = mask.astype(np.uint8) * 255
        if size != image.shape[::-1]:
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        scaled[name] = image > 0
    return scaled


def scaled_size(camera: Camera, long_side_px: int | None) -> tuple[int, int]:
    """(width, height) in px of a camera's images, scaled down to at most `long_side_px`."""
    return camera.pinhole(working_scale(camera, long_side_px)).size


def working_scale(camera: Camera, long_side_px: int | None) -> float:
    """Factor, at most 1, by which a camera's images are scaled."""
    return 1.0 if long_side_px is None else min(1.0, long_side_px / max(camera.size))


def as_recorded(image: Float32Array, camera: Camera) -> Float32Array:
    """An image (h, w) of a camera's pinhole, where its lens shows it."""
    if camera.is_pinhole:
        return image
    maps = _recorded_maps(camera, image.shape[1::-1])
    remapped = cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(remapped, np.float32)


@lru_cache(64)  # cameras of a recording, at two sizes
def _recorded_maps(camera: Camera, size: tuple[int, int]) -> tuple[Float32Array, Float32Array]:
    """Two (h, w) for cv2.remap, from recorded to pinhole, px, of images of a size (w, h)."""
    scale = camera.size[0] / size[0]
    x, y = np.meshgrid(*(scale * (np.arange(count) + 0.5) - 0.5 for count in size))
    seen = np.nan_to_num(camera.undistort(np.column_stack([x.ravel(), y.ravel()])), nan=-1)
    maps = ((seen + 0.5) / scale - 0.5).astype(np.float32)
    return maps[:, 0].reshape(x.shape), maps[:, 1].reshape(x.shape)


@dataclass(frozen=True, eq=False)
class UndistortedView:
    """Undistortion of a camera's silhouettes."""

    pinhole: Camera  #: Camera without distortion, of the size of the silhouettes.
    maps: tuple[np.ndarray, np.ndarray] | None
    """Two (h, w) float32 for cv2.remap, from pinhole to silhouette, px; None without distortion."""

    @classmethod
    def from_camera(cls, camera: Camera, long_side_px: int | None) -> UndistortedView:
        """Undistortion for silhouettes whose longer side is at most `long_side_px`."""
        scale = working_scale(camera, long_side_px)
        if camera.is_pinhole:
            return cls(camera.pinhole(scale), None)
        map_x, map_y = (
            (m + np.float32(0.5)) * np.float32(scale) - np.float32(0.5)
            for m in camera.pinhole_maps(scale)
        )
        return cls(camera.pinhole(scale), (map_x, map_y))

    def undistort(self, mask: BoolArray) -> BoolArray:
        """Silhouette (h, w) bool as the pinhole camera sees it."""
        if self.maps is None:
            return mask
        return cv2.remap(mask.view(np.uint8) * 255, *self.maps, cv2.INTER_LINEAR) > 127

    def undistort_unknown(self, mask: BoolArray) -> BoolArray:
        """Unknown places (h, w) bool as the pinhole camera sees them, also where in part."""
        if self.maps is None:
            return mask
        return cv2.remap(mask.view(np.uint8) * 255, *self.maps, cv2.INTER_LINEAR) > 0

    def undistort_part(
        self, picture: ByteArray, corner: tuple[int, int], size: tuple[int, int]
    ) -> ByteArray:
        """Part of a picture as the pinhole camera sees it.

        Args:
            picture: (H, W, 3) uint8, as recorded.
            corner: first column and row of the part in the pinhole camera's image.
            size: width and height of the part.

        Returns:
            (height, width, 3) uint8.
        """
        (left, top), (width, height) = corner, size
        if self.maps is None:
            x, y = np.meshgrid(
                np.arange(left, left + width, dtype=np.float32),
                np.arange(top, top + height, dtype=np.float32),
            )
        else:
            x, y = (m[top : top + height, left : left + width] for m in self.maps)
        scale = picture.shape[1] / self.pinhole.size[0]
        if scale != 1:
            x, y = ((m + np.float32(0.5)) * np.float32(scale) - np.float32(0.5) for m in (x, y))
        return cv2.remap(picture, x, y, cv2.INTER_LINEAR)  # type: ignore[return-value]
