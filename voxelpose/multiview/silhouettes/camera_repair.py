"""Cameras that were turned after calibration, or whose pictures come late: found and put right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.agreement import SUBFRAME, agreement
from calib.camera import Rig
from calib.checks import BoolArray, FloatArray, IntArray
from calib.errors import InputError
from calib.moments import even_moments
from calib.repair import Repair, explain
from calib.tangency import OutlineTrack
from calib.tuning import AGREEMENT
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.tuning import CAMERA_REPAIR

_MOMENTS = 12
_MOST_LATE = 12  # frames
_FEWEST = 4  # cameras: of three, the two others tell too little
_REMEDY = "voxelpose calibrate check RECORDING --repair OUT"
Unknown = Sequence[BoolArray] | None
_LOOK = f"look at the silhouettes (voxelpose view), and see {_REMEDY}"


@dataclass(frozen=True, eq=False)
class RepairedCameras:
    """Result of a check of the cameras against the silhouettes."""

    rig: Rig  #: the cameras, repaired where that was sure and wanted.
    late_frames: dict[str, int]  #: by how many frames a camera's pictures come late, by its name.
    words: tuple[str, ...] = ()  #: what was found, one sentence each.
    repaired: bool = False  #: whether something was put right.

    @property
    def in_doubt(self) -> bool:
        """Whether cameras disagree and nothing was put right."""
        return bool(self.words) and not self.repaired

    def then(self, later: RepairedCameras) -> RepairedCameras:
        """This and a later repair of the same cameras as one."""
        names = [*self.late_frames, *later.late_frames]
        late = {k: self.late_frames.get(k, 0) + later.late_frames.get(k, 0) for k in names}
        words = self.words + later.words if self.repaired else later.words
        return RepairedCameras(later.rig, late, words, later.repaired)


def repair_cameras(
    rig: Rig,
    store: MaskStore,
    times_s: FloatArray,
    fps: float,
    *,
    put_right: bool,
    unknown: Unknown = None,
) -> RepairedCameras:
    """Checks cameras against the silhouettes of a dozen moments.

    Repairs are sure where, of four cameras or more, the others agree, and with the turned and late
    ones put right all agree, or none of these disagrees any more and the error has become small.
    What no repair explains, as lost limbs, is left as it is.

    Args:
        rig: the pinhole cameras of the silhouettes.
        store: silhouettes of T frames.
        times_s: (T,) times of the frames, s.
        fps: frames per second.
        put_right: whether sure repairs are made; otherwise they are only told.
        unknown: C arrays (h, w) bool, where nothing is known; None: nowhere.
    """
    unchanged = RepairedCameras(rig, {})
    moments = even_moments(len(store), _MOMENTS)
    if len(rig) < 3 or len(moments) < 3:
        return unchanged
    moments_s = times_s[moments]
    tracks = _tracks(rig, store, moments, times_s, unknown)
    try:
        checked = agreement(list(tracks.values()), moments_s)
        if checked.agrees:
            return unchanged
        if not checked.culprits:
            views = ", ".join(f"{camera.name} {camera.view_deg:.0f}" for camera in rig)
            modes = (
                f"were the lenses set to the fields of view of the calibration ({views} degrees)?"
            )
            return replace(unchanged, words=(f"{checked.summary}: {modes} {_LOOK}",))
        most = min(_MOST_LATE, (len(store) - 1) // 3)
        near = np.unique(
            np.clip(moments[:, None] + np.arange(-most - 1, most + 2), 0, len(store) - 1)
        )
        tracks |= _tracks(rig, store, near, times_s, unknown, checked.culprits)
        repairs = explain(tracks, checked, moments_s, most / fps)
        small, repaired = [repair for repair in repairs if _is_small(repair)], rig
        for repair in small:
            repaired = repair.rig(repaired)
        offsets_s = {repair.camera: repair.offset_s for repair in small}
        after = agreement(
            [track.with_camera(repaired[name]) for name, track in tracks.items()],
            moments_s,
            offset_s=offsets_s,
        )
    except InputError:  # a camera never sees somebody together with another
        return unchanged
    if all(
        repair.kind == "out of step" and abs(repair.offset_s) * fps <= SUBFRAME
        for repair in repairs
    ):
        return unchanged
    disagreeing = set(offsets_s) & set(after.culprits)
    improved = after.error_px < checked.error_px / AGREEMENT.explained_gain and not disagreeing
    unexplained = len(repairs) - len(small)  # by shadows or lost limbs, perhaps
    if not (small and (after.agrees or improved) and len(rig) - unexplained >= _FEWEST):
        rescaled = [repair.summary for repair in repairs if repair.kind == "scaled"]
        return replace(unchanged, words=(f"{'; '.join([checked.summary, *rescaled])}: {_LOOK}",))
    summary = "; ".join(repair.summary for repair in small)
    if not put_right:
        return replace(unchanged, words=(f"{summary}: --repair auto puts it right",))
    words = f"{summary}: put right for this result; calibrate again, or see {_REMEDY}"
    late = {name: round(seconds * fps) for name, seconds in offsets_s.items()}
    return RepairedCameras(repaired, {name: k for name, k in late.items() if k}, (words,), True)


def _is_small(repair: Repair) -> bool:
    return repair.kind == "out of step" or (
        repair.kind == "turned" and repair.turned_deg <= CAMERA_REPAIR.most_turned_deg
    )


def _tracks(
    rig: Rig,
    store: MaskStore,
    frames: IntArray,
    times_s: FloatArray,
    unknown: Unknown,
    names: Sequence[str] | None = None,
) -> dict[str, OutlineTrack]:
    """Outlines of some frames, of all cameras or of those named."""
    hidden = [None] * len(rig) if unknown is None else unknown
    chosen = [c for c, name in enumerate(rig.names) if names is None or name in names]
    masks: dict[int, list[BoolArray]] = {c: [] for c in chosen}
    for frame in frames.tolist():
        seen = store[frame]
        for c in chosen:
            masks[c].append(seen[c])
    return {
        rig.names[c]: OutlineTrack.from_masks(rig.cameras[c], times_s[frames], masks[c], hidden[c])
        for c in chosen
    }
