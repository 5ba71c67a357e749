"""Draws the pictures of docs/python.md: `python -m docs.figures.examples` runs the examples and
writes docs/images/example_*.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "images"
_WIDTH = 1000


def main() -> None:
    """Runs the examples and writes the pictures."""
    with tempfile.TemporaryDirectory() as out:
        for example in sorted((ROOT / "examples").glob("0*.py")):
            subprocess.run([sys.executable, str(example), out], check=True)
        write_pictures(Path(out))


def write_pictures(out: Path) -> None:
    """Writes small copies of the pictures that the examples left in a folder."""
    for path in sorted(out.glob("0*.png")):
        picture = cv2.imread(str(path))
        if picture is None:
            raise OSError(f"{path} cannot be read")
        small = cv2.resize(
            picture,
            (_WIDTH, round(picture.shape[0] * _WIDTH / picture.shape[1])),
            interpolation=cv2.INTER_AREA,
        )
        name = path.stem[3:]
        if name == "evaluate":  # lines and letters
            cv2.imwrite(str(IMAGES / f"example_{name}.png"), small)
        else:
            cv2.imwrite(str(IMAGES / f"example_{name}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, 80])


if __name__ == "__main__":
    main()
