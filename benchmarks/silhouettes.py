"""Background subtraction against its formula in NumPy."""

import numpy as np
from numpy.typing import NDArray

from benchmarks.cases import Case, Timed, case
from benchmarks.scene import ring
from benchmarks.scene import silhouettes as drawn
from silhouette_core.image.background import BackgroundModel
from silhouette_core.tuning import BACKGROUND
from tests.oracles import image as reference


def _synthetic() -> tuple[list[NDArray[np.uint8]], NDArray[np.uint8]]:
    """Noisy frames of an empty room, and one with a person, (480, 640, 3) uint8."""
    rng = np.random.default_rng(0)
    room = rng.integers(60, 200, (480, 640, 3)).astype(np.float64)
    mask = drawn(ring(1))[0]

    def noisy(picture: NDArray[np.float64]) -> NDArray[np.uint8]:
        return np.clip(np.rint(picture + rng.normal(0, 2, picture.shape)), 1, 255).astype(np.uint8)

    return [noisy(room) for _ in range(10)], noisy(
        np.where(mask[..., None], (40.0, 60.0, 180.0), room)
    )


@case("silhouette 640 x 480, paper 5.1")
def paper_silhouette() -> Case:
    frames, frame = _synthetic()
    model = BackgroundModel.from_frames(frames, "paper")
    colours = np.stack(frames).astype(np.float64)
    units = colours / np.linalg.norm(colours, axis=3, keepdims=True)
    mean, unit_mean = colours.mean(0), units.mean(0)
    variance = np.maximum(
        units.var(0), (BACKGROUND.noise / np.linalg.norm(mean, axis=2, keepdims=True)) ** 2
    )
    log_peak = -0.5 * np.log(2 * np.pi * variance).sum(axis=2)
    limits, mask = (
        (BACKGROUND.log_likelihood, BACKGROUND.raw_difference),
        np.empty(mean.shape[:2], bool),
    )

    def formula(_: None) -> NDArray[np.bool_]:
        reference.paper_mask(frame, mean, unit_mean, 0.5 / variance, log_peak, *limits, mask)
        return mask

    def check(ours: NDArray[np.bool_], theirs: NDArray[np.bool_]) -> str:
        differing = np.count_nonzero(ours ^ theirs)  # ours computes in float32
        return f"{differing} pixels differ" if differing > 10 else ""

    return Case(
        Timed(lambda _: model.silhouette(frame), repeats=20),
        Timed(formula, repeats=2),
        "the formula in NumPy",
        check,
    )


@case("silhouette 640 x 480, refined")
def refined_silhouette() -> Case:
    frames, frame = _synthetic()
    refined, paper = (
        BackgroundModel.from_frames(frames, method) for method in ("refined", "paper")
    )
    ours, theirs = (
        Timed(lambda _, model=model: model.silhouette(frame), repeats=10)
        for model in (refined, paper)
    )
    return Case(ours, theirs, "paper 5.1 as written", longer=True)
