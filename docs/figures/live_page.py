"""Takes the picture of docs/live.md: `python -m docs.figures.live_page` runs the live demo, opens
its page in Chromium (`make browser`) and writes docs/images/live.jpg.
"""

import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from tests.browsing import new_page

IMAGE = Path(__file__).parents[1] / "images" / "live.jpg"
_SETTLED_MS = 20_000  # after which the session has run for a while


def main() -> None:
    """Writes the picture."""
    with tempfile.TemporaryDirectory() as out, new_page(1200, 720) as (browser, _):
        command = [sys.executable, "-m", "voxelpose", "demo", "--out", out, "--live"]
        process = subprocess.Popen(
            [*command, "--overwrite", "--no-browser"], stderr=subprocess.PIPE, text=True
        )
        assert process.stderr is not None
        try:
            url = next(line.split()[1] for line in process.stderr if line.startswith("page: "))
            browser.goto(url)
            browser.get_by_text("following", exact=True).first.wait_for(timeout=90_000)
            browser.wait_for_timeout(_SETTLED_MS)
            browser.get_by_text("following", exact=True).first.wait_for(timeout=90_000)
            shown = cv2.imdecode(np.frombuffer(browser.screenshot(), np.uint8), cv2.IMREAD_COLOR)
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate()
    cv2.imwrite(str(IMAGE), shown, [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
