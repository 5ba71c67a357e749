"""Listed points: each mistake is named with its line."""

import pytest

from calib.errors import InputError
from calib.points import read_points

HEADER = "camera,point,x_px,y_px,x_m,y_m,z_m\n"


def test_points_with_and_without_metres(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text(HEADER + "cam_1,a,1,2,0,0.5,1\ncam_2, a,3,4,,,\n")
    points = read_points(path)
    assert points.pixels["a"]["cam_2"].tolist() == [3, 4]
    assert points.known_m["a"].tolist() == [0, 0.5, 1]
    path.write_text("camera,point,x_px,y_px\ncam_1,a,1,2\n")
    assert read_points(path).known_m == {}


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("cam_1,a,1e308,2,,,\n", "line 2: x_px, y_px hold 1e\\+308, beyond 1e\\+06"),
        ("cam_1,a,1,2,0,0,1e300\n", "line 2: x_m, y_m, z_m hold 1e\\+300"),
        ("cam_1,a,nan,2,,,\n", "line 2: x_px, y_px must be numbers"),
        ("cam_1\n", "line 2: x_px, y_px must be numbers"),
        ("cam_1," + "a" * 5000 + ",1,2,,,\n", "line 2: no name has 5000 letters"),
        ("cam_1,a,1,2,,,\ncam_1,a,1,2,,,\n", "line 3: point a is listed twice"),
        ('"' + "cam_1,a,1,2,,,\n" * 20_000, "a stray quote"),
    ],
)
def test_damaged_rows_are_named(tmp_path, rows, message):
    (tmp_path / "points.csv").write_text(HEADER + rows)
    with pytest.raises(InputError, match=message) as caught:
        read_points(tmp_path / "points.csv")
    assert "points.csv" in str(caught.value) and len(str(caught.value)) < 400
