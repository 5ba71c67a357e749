"""Takes the picture of docs/viewing.md: `python -m docs.figures.viewer_page` fits the demo's
recording, shows it in Chromium (`make browser`) and writes docs/images/viewer.jpg.
"""

import tempfile
from pathlib import Path

import cv2
import numpy as np

from tests.browsing import new_page
from voxelpose.cli import run
from voxelpose.demo.room import make_recording
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.result_scenes import ResultScenes

IMAGE = Path(__file__).parents[1] / "images" / "viewer.jpg"
_FRAME = 22
_WAIT_MS = 120_000


def main() -> None:
    """Writes the picture."""
    with tempfile.TemporaryDirectory() as folder:
        recording, out = Path(folder, "walk"), Path(folder, "walk_fit")
        make_recording(recording)
        if run(["fit", str(recording), "--out", str(out), "--stature", "1.75", "--no-pictures"]):
            raise SystemExit("the fit failed")
        browser = Browser(ResultScenes(out), Address(port=0), _FRAME)
        try:
            pictures = [*_wide(browser.url), _narrow(browser.url)]
        finally:
            browser.close()
    height = min(len(picture) for picture in pictures)
    whole = np.hstack([_of_height(picture, height) for picture in pictures])
    whole = cv2.resize(whole, None, fx=0.62, fy=0.62, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(IMAGE), whole, [cv2.IMWRITE_JPEG_QUALITY, 86])


def _wide(url: str) -> list[np.ndarray]:
    """The page, its voxels by parts, and the view through a camera."""
    with new_page(1180, 760) as (page, _):
        page.goto(url)
        page.locator(".follows").wait_for(state="hidden", timeout=_WAIT_MS)
        shown = [_picture(page)]
        page.get_by_label("Body", exact=True).uncheck()
        page.get_by_label("Hull as").select_option("cubes")
        page.get_by_label("Colours of the hull").select_option("parts")
        shown.append(_picture(page)[38:-60, 210:640])
        page.get_by_label("Body", exact=True).check()
        page.get_by_label("Hull", exact=True).uncheck()
        page.get_by_role("button", name="cam_2").click()
        page.wait_for_function("() => viewer.large !== null", timeout=_WAIT_MS)
        shown.append(_picture(page)[38:-60, 190:660])
    return shown


def _narrow(url: str) -> np.ndarray:
    """The page on a telephone."""
    with new_page(420, 760) as (page, _):
        page.goto(url)
        page.locator(".follows").wait_for(state="hidden", timeout=_WAIT_MS)
        return _picture(page)


def _picture(page) -> np.ndarray:
    page.wait_for_timeout(1500)
    data = np.frombuffer(page.screenshot(), np.uint8)
    picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if picture is None:
        raise SystemExit("the browser gave no picture")
    return picture


def _of_height(picture: np.ndarray, height: int) -> np.ndarray:
    scale = height / len(picture)
    return cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)[:height]


if __name__ == "__main__":
    main()
