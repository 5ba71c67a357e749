"""The person among the labels of masks: the one that is asked for, the only one that moves, or all
where they are the parts of one.

What is not plain is asked about: two that move, black and white exchanged, pictures for masks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.read_ahead import side_by_side
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.mask_levels import MaskForm, MaskLevels
from voxelpose.recording.masks import MaskReader, MaskRule, half_cut_out, may_be_transparent

_STILL_PERCENT = 95  # of a label's pixels, which are the same in all pictures
_PIECE_PERCENT = 90  # of the pixels of labels that are one body, and of the pictures where they are
_FEWEST = 3  # pictures that show whether something moves
_VOID = "255"  # beside small labels: what nobody decided on, as in PASCAL VOC
_NEAR = 8  # part of the largest value, by which a shade may be off
_MOST_LABELS = 8  # of colours with shades; more are a person's picture


@dataclass(frozen=True, eq=False)
class _Look:
    """A look at the masks of a camera."""

    reader: MaskReader
    form: MaskForm
    levels: MaskLevels

    @classmethod
    def at(cls, reader: MaskReader, labels: bool = True) -> "_Look":
        layers = reader.samples()
        form = MaskForm.of(layers, labels)
        if form.alpha and any(one.alpha is None for one in layers):
            raise half_cut_out(reader.path)
        labels = form.coloured or not form.alpha
        return cls(reader, form, MaskLevels.of([form.plane(one) for one in layers], labels))

    @property
    def names(self) -> list[str]:
        """Labels, the background first, as the option `--label` takes them."""
        return [self._name(value) for value in self.levels.values]

    def _name(self, value: NDArray[np.float64]) -> str:
        if len(value) == 3:
            return "".join(f"{min(int(channel), 255):02x}" for channel in value[::-1])
        return f"{round(value[0] / (self.form.scale or 1), 4):g}"

    def value(self, name: str) -> NDArray[np.float64] | None:
        """The value (C,) of a label by its name; None where it can be none of these masks."""
        try:
            if self.form.coloured:
                number = int(name, 16) if len(name) == 6 else -1
                return np.array([number >> shift & 255 for shift in (0, 8, 16)], float)
            return np.array([float(name) * (self.form.scale or 1)])
        except ValueError:
            return None

    def near(self, name: str) -> str | None:
        """The label that there is by a name that is asked for; of shades the nearest one."""
        value = self.value(name)
        if value is None:
            return None
        distance = np.abs(self.levels.values - value).max(axis=1)
        least = 0.5 if self.levels.exact else self.levels.top / _NEAR
        return self.names[int(distance.argmin())] if distance.min() <= least else None

    @property
    def cut_out(self) -> bool:
        """Whether the person's own colours are there, before a background without any."""
        levels = self.levels
        several = len(levels.values) > _MOST_LABELS
        return self.form.coloured and not levels.exact and (several or not levels.compact)

    def moves(self, name: str) -> bool:
        """Whether a label's pixels change."""
        masks = self._masks([name])
        if len(masks) < _FEWEST:
            return True
        usual = 2 * np.sum(masks, axis=0) > len(masks)
        same = [np.count_nonzero(m & usual) / max(np.count_nonzero(m | usual), 1) for m in masks]
        return 100 * float(np.median(same)) < _STILL_PERCENT

    def one_piece(self, names: Sequence[str]) -> bool:
        """Whether labels together are one piece, in nearly all pictures."""
        kernel = np.ones((5, 5), np.uint8)
        whole = []
        for mask in self._masks(names):
            closed = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, kernel)
            areas = cv2.connectedComponentsWithStats(closed)[2][1:, cv2.CC_STAT_AREA]
            whole.append(100 * int(areas.max()) >= _PIECE_PERCENT * int(areas.sum()))
        return 100 * sum(whole) >= _PIECE_PERCENT * len(whole)

    def _masks(self, names: Sequence[str]) -> list[NDArray[np.bool_]]:
        """Where any of the labels is, in the pictures that have one."""
        wanted = [k for k, name in enumerate(self.names) if name in names]
        masks = [np.isin(index, wanted) for index in self.levels.indices]
        return [mask for mask in masks if mask.any() and mask.shape == masks[0].shape]

    def no_cut_out(self) -> str:
        """Why the opacity of pictures is no silhouette, in words; "" where it is one."""
        if not self.levels.bordered or self.levels.values[0].any():
            return "not transparent along their borders"
        first, *others = self.levels.indices
        still = len(others) + 1 >= _FEWEST and all(np.array_equal(first, each) for each in others)
        return "the same in all of them" if still else ""

    def check(self) -> None:
        """Checks that the masks can be understood without being asked about. InputError where they
        are pictures, or white at their borders.
        """
        path, levels = self.reader.path, self.levels
        if not levels.exact and not levels.bordered:
            raise InputError(
                f"{path} holds pictures, not masks: put them into the recording's folder itself,"
                " beside the calibration"
            )
        border, *others = levels.values[:, 0]
        if not self.form.coloured and len(others) < 2 and border > max([0, *others]):
            white, black = (*self.names, "0")[:2]
            raise InputError(
                f"{path} is {'opaque' if self.form.alpha else 'white'} along its border: are"
                f" person and background exchanged? If so give --label {black}, if the person is"
                f" that near, --label {white}"
            )

    def rule(self, chosen: Sequence[str]) -> MaskRule:
        """Rule by which the pixels of some labels are the person's."""
        levels, names = self.levels, self.names
        outside = np.array([name not in chosen for name in names])
        whole = outside[0] and not outside[1:].any() and (len(names) != 2 or self.cut_out)
        values = [value for name in chosen if (value := self.value(name)) is not None]
        return MaskRule(
            self.form,
            None if whole or not values else np.array(values),
            levels.values[:1] if whole else levels.values[outside],
            levels.noise,
            levels.exact,
        )


def open_masks(
    paths: Mapping[str, Path], label: str | None = None
) -> tuple[dict[str, MaskReader], tuple[str, ...]]:
    """Readers of masks by camera name, and what is worth telling about them. InputError where they
    cannot be read, or do not say by themselves who is the person.

    Args:
        label: labels of the person, with commas between them: numbers, or colours as rrggbb; None:
            found.
    """
    readers = {name: MaskReader.open(path) for name, path in paths.items()}
    looks = dict(zip(readers, side_by_side(_Look.at, list(readers.values())), strict=True))
    if label is None:
        for look in looks.values():
            look.check()
        chosen, notes = _person(looks)
    else:
        chosen, notes = _asked_for(looks, label), ()
    return {
        name: replace(look.reader, rule=look.rule(chosen.get(name, look.names[1:])))
        for name, look in looks.items()
    }, notes


def cut_outs(readers: Mapping[str, FrameReader]) -> tuple[dict[str, MaskReader], tuple[str, ...]]:
    """Readers of the silhouettes that frames hold in their opacity, by camera name, and what is
    worth telling; no readers where frames are no cut-outs. InputError where only some of the
    cameras' frames are cut-outs.
    """
    layered = {
        name: MaskReader.open(reader.path)
        for name, reader in readers.items()
        if may_be_transparent(reader)
    }
    look = partial(_Look.at, labels=False)
    looks = dict(zip(layered, side_by_side(look, list(layered.values())), strict=True))
    doubts = {name: look.no_cut_out() for name, look in looks.items() if look.form.alpha}
    if "" not in doubts.values():
        return {}, tuple(
            f"the opacity of the frames of {name} is {doubt} and is not used: if it is the person's"
            " silhouette, put them into masks/"
            for name, doubt in doubts.items()
        )
    if others := [name for name in readers if doubts.get(name) != ""]:
        raise InputError(
            f"frames of {', '.join(doubts.keys() - {*others})} are cut-outs, whose opacity is the"
            f" silhouette, and those of {', '.join(others)} are not: cut out all, or take the"
            " opacity out of all"
        )
    silhouettes = {
        name: replace(look.reader, rule=look.rule(look.names[1:])) for name, look in looks.items()
    }
    return silhouettes, ("frames are cut-outs: their opacity is used as silhouettes, no colours",)


def _person(looks: Mapping[str, _Look]) -> tuple[dict[str, list[str]], tuple[str, ...]]:
    """Labels of the person by camera name, where there are several, and words about the choice."""
    several = [look for look in looks.values() if len(look.names) > 2 and not look.cut_out]
    names = list(dict.fromkeys(name for look in several for name in look.names[1:]))
    if looks and not any(look.levels.top for look in looks.values()):
        folder = next(iter(looks.values())).reader.path.parent
        raise InputError(f"{folder} marks nobody: every pixel is 0; write the masks anew")
    if not names:
        return {}, ()
    if _VOID in names and all(name == _VOID or float(name) < int(_VOID) / 2 for name in names):
        names.remove(_VOID)
    answers = {n: [look.moves(n) for look in several if n in look.names] for n in names}
    moving = [name for name, moves in answers.items() if 2 * sum(moves) > len(moves)]
    if not moving or not (len(moving) == 1 or all(look.one_piece(moving) for look in several)):
        raise InputError(
            f"{several[0].reader.path.parent} has labels {', '.join(names)}, and"
            f" {'several of them move' if moving else 'none of them moves'}: which is the person?"
            f" Give --label {(moving or names)[0]}, or another"
        )
    chosen = {n: moving for n, look in looks.items() if {*look.names[1:]} & {*names}}
    if not all(look.levels.exact for look in several):
        return chosen, ()
    if len(moving) == 1:
        words = f"of labels {', '.join(names)} only {moving[0]} moves and is taken for the person"
    else:
        words = f"labels {', '.join(moving)} are one piece and are taken for one person"
    return chosen, (f"masks: {words}; --label chooses",)


def _asked_for(looks: Mapping[str, _Look], label: str) -> dict[str, list[str]]:
    """The labels that are asked for by camera name. InputError where no camera has one of them."""
    wanted = [word.strip().lower() for word in label.split(",")]
    matches = {
        word: {name: near for name, look in looks.items() if (near := look.near(word)) is not None}
        for word in wanted
    }
    for word in wanted:
        if not matches[word]:
            names = dict.fromkeys(name for look in looks.values() for name in look.names)
            raise InputError(
                f"the masks have no label {word[:40]!r}: give --label {' or '.join(names)}"
            )
    return {name: [matches[word].get(name, word) for word in wanted] for name in looks}
