"""Takes the pictures of docs/studio.md: `python -m docs.figures.studio_page` brings the demo's
recording through the studio in Chromium (`make browser`) and writes docs/images/studio.jpg and
studio_narrow.jpg.
"""

import tempfile
from pathlib import Path

import cv2
import numpy as np

from tests.browsing import new_page
from tests.voxelpose.studio.studio_scenes import opened_studio
from voxelpose.demo.room import make_recording

IMAGES = Path(__file__).parents[1] / "images"
_FIT_MS = 300_000


def main() -> None:
    """Writes the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        root, files = Path(folder, "takes"), Path(folder, "files")
        root.mkdir()
        make_recording(files)
        with opened_studio(root) as server:
            wide = _walked_through(server.url, files)
            narrow = _narrow(server.url)
    rows = [np.hstack(wide[:2]), np.hstack(wide[2:])]
    whole = cv2.resize(np.vstack(rows), None, fx=0.56, fy=0.56, interpolation=cv2.INTER_AREA)
    _write("studio.jpg", whole)
    _write("studio_narrow.jpg", np.hstack(narrow))


def _walked_through(url: str, files: Path) -> list[np.ndarray]:
    """Pictures of four steps, from an empty folder on."""
    shown = []
    with new_page(1200, 700) as (page, _):
        page.goto(url)
        page.locator("#new_name").fill("walk")
        page.keyboard.press("Enter")
        for place, pattern in (
            ("video", "cam_*.mp4"),
            ("background", "background/*"),
            ("calibration", "calibration.toml"),
        ):
            paths = sorted(files.glob(pattern))
            page.locator(f'input[data-place="{place}"]').set_input_files(paths)
            page.get_by_role("button", name=f"Remove {paths[-1].relative_to(files)}").wait_for()
        page.locator("#read_line").wait_for()
        shown.append(_picture(page))
        page.get_by_role("link", name="Next: Check").click()
        page.locator(".tile").nth(3).wait_for()
        page.locator('[data-tool="check"]').click()
        page.locator("#start_check").click()
        page.locator("#check_summary").wait_for(timeout=120_000)
        shown.append(_picture(page))
        page.locator("#next").click()
        page.locator("#set_stature").fill("1.75")
        page.locator("#start").click()
        page.locator("#stage_line").get_by_text("left").wait_for(timeout=120_000)
        page.wait_for_timeout(5000)
        shown.append(_picture(page))
        page.locator("#next").click(timeout=_FIT_MS)
        page.get_by_role("link", name="Next: Export").click()
        page.locator("#start").click()
        page.locator("#download").wait_for(timeout=120_000)
        shown.append(_picture(page))
    return shown


def _narrow(url: str) -> list[np.ndarray]:
    """Pictures of three steps on a telephone."""
    shown = []
    for step in ("import", "fit", "view"):
        with new_page(420, 760) as (page, _):
            page.goto(f"{url}/#{step}/walk")
            page.locator(".card, .group").first.wait_for()
            shown.append(_picture(page))
    return shown


def _picture(page) -> np.ndarray:
    page.wait_for_timeout(700)
    image = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return cv2.copyMakeBorder(image, 3, 3, 3, 3, cv2.BORDER_CONSTANT, value=(255, 255, 255))


def _write(name: str, image: np.ndarray) -> None:
    cv2.imwrite(str(IMAGES / name), image, [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main()
