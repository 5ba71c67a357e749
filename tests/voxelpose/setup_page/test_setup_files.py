"""What the setup page saves is what the project's readers read, and nothing else is lost."""

import csv

import cv2
import msgspec
import numpy as np
import pytest

from calib.errors import InputError
from calib.points import read_points
from calib.upright import UprightFrame
from tests.sources import ring, write_recording
from tests.voxelpose.setup_page.setup_scenes import SIZE, opened, staged
from voxelpose.cli.options import folder_settings
from voxelpose.recording.folder import Recording
from voxelpose.setup_page.clicked_points import (
    ground_lines,
    point_errors,
    read_clicked,
    save_clicked,
    up_choices,
)
from voxelpose.setup_page.drawn_places import change_section, check_choices
from voxelpose.setup_page.opened_folder import OpenedFolder
from voxelpose.setup_page.page_requests import (
    PlacesDrawn,
    PointClicked,
    RegionDrawing,
    SaveRequest,
    SilhouetteRequest,
    StageRequest,
)

SQUARE = [(40.0, 30.0), (199.6, 30.0), (199.6, 180.2), (40.0, 180.2)]
TRIANGLE = [(200.0, 100.0), (300.0, 100.0), (250.0, 200.0)]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return staged(tmp_path_factory.mktemp("setup") / "walk")


@pytest.fixture
def walk(tmp_path):
    return write_recording(tmp_path / "walk", ring(3, SIZE))


def regions(**drawings) -> SaveRequest:
    return SaveRequest(places=PlacesDrawn(regions=drawings))


def unknown(**polygons) -> SaveRequest:
    return SaveRequest(places=PlacesDrawn(unknown=polygons))


def test_a_region_is_white_inside_and_its_corners_come_back(walk):
    saved = opened(walk).save(regions(cam_2=RegionDrawing(True, [SQUARE, TRIANGLE])))
    assert saved["written"] == ["regions/cam_2.png"] and not saved["removed"]
    mask = Recording.open(walk).regions()["cam_2"]
    assert mask[31, 41] and mask[110, 250] and mask[180, 200] and not mask[10, 10]
    assert not mask[181, 100] and mask.sum() > 161 * 151
    state = opened(walk).state()
    assert [tuple(corner) for corner in state["regions"]["cam_2"][0]] == SQUARE
    assert not state["cameras"][1]["painted_region"]
    removed = opened(walk).save(regions(cam_2=RegionDrawing(True, [])))
    assert removed["removed"] == ["regions/cam_2.png"] and not Recording.open(walk).regions()


def test_a_painted_region_is_kept_until_it_is_given_up(walk):
    (walk / "regions").mkdir()
    painted = np.zeros(SIZE[::-1], np.uint8)
    painted[:50] = 255
    cv2.imwrite(str(walk / "regions" / "cam_1.bmp"), painted)
    session = opened(walk)
    assert session.state()["cameras"][0]["painted_region"]
    saved = session.save(regions(cam_1=RegionDrawing(True, [TRIANGLE])))
    assert (saved["written"], saved["removed"]) == (["regions/cam_1.png"], ["regions/cam_1.bmp"])
    mask = Recording.open(walk).regions()["cam_1"]
    assert mask[:50].all() and mask[110, 250] and not mask[60, 10]
    session.save(regions(cam_1=RegionDrawing(False, [TRIANGLE])))
    mask = Recording.open(walk).regions()["cam_1"]
    assert not mask[:50].any() and mask[110, 250]


def test_a_region_that_leaves_nothing_is_refused(walk):
    outside = [(-90.0, -90.0), (-80.0, -90.0), (-80.0, -80.0)]
    with pytest.raises(InputError, match="outside of its picture"):
        opened(walk).save(regions(cam_1=RegionDrawing(True, [outside])))
    assert not (walk / "regions").exists()


def test_unknown_places_are_those_of_the_reader_and_comments_stay(walk):
    (walk / "recording.toml").write_text(
        "# the desk\n[unknown]\ncam_1 = [[[0, 0], [9, 0], [9, 9]]]  # of Tuesday\n"
        "cam_3 = [[[0, 0], [50, 0], [50, 50]]]\n"
    )
    opened(walk).save(unknown(cam_2=[SQUARE], cam_3=[]))
    text = (walk / "recording.toml").read_text()
    assert "# the desk" in text and "# of Tuesday" in text and "cam_3" not in text
    assert "[199.6, 180.2]" in text and "[40, 30]" in text
    masks = Recording.open(walk).unknown()
    assert masks.keys() == {"cam_1", "cam_2"} and masks["cam_1"].sum() == 55
    assert masks["cam_2"][100, 100] and not masks["cam_2"][200, 100]
    session = opened(walk)
    preview = session._places.unknown_masks(PlacesDrawn(unknown={"cam_2": [SQUARE]}))
    assert all(np.array_equal(preview[name], mask) for name, mask in masks.items())


def test_points_are_written_as_calibrate_reads_them(walk):
    rows = [
        "camera,point,x_px,y_px,x_m,y_m,z_m,by",
        "cam_1,tile,10.25,20,0,0,0.1,Ann",
        "other,tile,3,4,,,,Bob",
    ]
    (walk / "points.csv").write_text("\n".join(rows) + "\n")
    points = read_clicked(walk / "points.csv")
    assert points[0].position_m == (0.0, 0.0, 0.1) and set(points[0].pixels) == {"cam_1", "other"}
    points.append(PointClicked("post, top".replace(",", ""), {"cam_2": (7.4, 8.0)}))
    points.append(PointClicked("nowhere", {}, (1.0, 2.0, 3.0)))
    assert save_clicked(walk / "points.csv", points) == ["nowhere"]
    found = read_points(walk / "points.csv")
    assert found.pixels["tile"]["cam_1"].tolist() == [10.25, 20]
    assert found.pixels["post top"]["cam_2"].tolist() == [7.4, 8]
    assert found.known_m["tile"].tolist() == [0, 0, 0.1] and "nowhere" not in found.pixels
    with (walk / "points.csv").open(newline="") as file:
        assert [row["by"] for row in csv.DictReader(file)] == ["Ann", "Bob", ""]


def test_errors_of_points_are_distances_to_where_the_calibration_puts_them():
    rig = ring(3, SIZE, (-0.2, 0.05, 0.0, 0.0))
    place = np.array([0.3, -0.2, 1.1])
    pixels = {camera.name: camera.project(place[None])[0][0] for camera in rig}
    exact = {name: (float(x), float(y)) for name, (x, y) in pixels.items()}
    off = exact | {"cam_2": (exact["cam_2"][0] + 3, exact["cam_2"][1] - 4)}
    points = [PointClicked("measured", off, (0.3, -0.2, 1.1)), PointClicked("seen", exact)]
    found = point_errors([*points, PointClicked("once", {"cam_1": (3, 4)})], rig)
    assert found["measured"]["pixels"]["cam_2"]["error_px"] == pytest.approx(5)
    assert found["measured"]["pixels"]["cam_1"]["error_px"] == pytest.approx(0, abs=1e-6)
    assert found["seen"]["position_m"] == pytest.approx(place.tolist(), abs=1e-6)
    assert not found["seen"]["measured"] and "once" not in found


def test_settings_are_those_of_fit_and_the_rest_of_the_file_stays(walk):
    path = walk / "voxelpose.toml"
    path.write_text('# mine\n[live]\nframes = 3\n\n[fit]\nsmooth = false  # keep\nrepair = "off"\n')
    given = {"background": "paper", "tolerance": 1, "voxel": 0.02, "cameras": "cam_1,cam_3"}
    given["up"] = "-z"
    chosen = given | {"repair": None}
    check_choices(chosen, ("cam_1", "cam_2", "cam_3"))
    path.write_text(path.read_text().replace("[live]\nframes = 3\n", ""))
    assert change_section(path, "fit", chosen)
    found = {name: each.value for name, each in folder_settings("fit", walk).items()}
    assert found == given | {"smooth": False}
    assert "# mine" in path.read_text() and "# keep" in path.read_text()
    assert not change_section(walk / "none.toml", "fit", {"up": None})


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"up": "sideways"}, "no direction"),
        ({"up": "0,0,nan"}, "no direction"),
        ({"cameras": "cam_9"}, "no camera 'cam_9'"),
        ({"voxel": 0.2}, "voxel = '0.2' must be a number from 0.005 to 0.1"),
    ],
)
def test_settings_that_make_no_sense_write_nothing(walk, chosen, words):
    session = opened(walk)
    request = SaveRequest(
        PlacesDrawn(unknown={"cam_1": [TRIANGLE]}), [PointClicked("a", {"cam_1": (1, 1)})], chosen
    )
    with pytest.raises(InputError, match=words):
        session.save(request)
    assert not {"recording.toml", "points.csv", "voxelpose.toml"} & {p.name for p in walk.iterdir()}


def test_damaged_files_are_named_when_the_page_opens(walk):
    for name, text in (("points.csv", "camera\n"), ("recording.toml", "[unknown\n")):
        (walk / name).write_text(text)
        with pytest.raises(InputError, match=name):
            opened(walk)
        (walk / name).unlink()
    (walk / "regions").mkdir()
    cv2.imwrite(str(walk / "regions" / "cam_1.png"), np.zeros((5, 5), np.uint8))
    with pytest.raises(InputError, match=r"cam_1.png is 5 x 5"):
        opened(walk)


def test_silhouettes_follow_what_is_drawn_but_not_saved(recorded):
    session = opened(recorded)
    request = SilhouetteRequest(3)
    while not (found := session.silhouettes(request))["ready"]:
        pass
    whole = {name: each["share"] for name, each in found["cameras"].items()}
    assert all(0.01 < share < 0.3 for share in whole.values()) and not found["guessed"]
    upper = [(0.0, 0.0), (319.0, 0.0), (319.0, 110.0), (0.0, 110.0)]
    places = PlacesDrawn({"cam_1": RegionDrawing(True, [upper])}, {"cam_2": [upper]})
    drawn = session.silhouettes(msgspec.structs.replace(request, places=places))["cameras"]
    assert 0.1 * whole["cam_1"] < drawn["cam_1"]["share"] < 0.9 * whole["cam_1"]
    assert 0.1 * whole["cam_2"] < drawn["cam_2"]["share"] < 0.9 * whole["cam_2"]
    assert drawn["cam_3"]["share"] == whole["cam_3"]
    with pytest.raises(InputError, match="no moment 8"):
        session.silhouettes(SilhouetteRequest(8))


def test_a_pixel_is_explained_by_the_stages_of_its_silhouette(recorded):
    session = opened(recorded)
    request = StageRequest(3, camera="cam_1", stage="odds", pixel=(160.0, 120.0))
    while not (found := session.stage(request))["ready"]:
        pass
    assert found["png"].startswith(b"\x89PNG")
    told = found["explained"]
    assert told["person"] and told["why"] == "its colours say so"
    assert told["here"] == [230, 160, 90] and told["background"] == [50, 60, 70]
    upper = [(0.0, 0.0), (319.0, 0.0), (319.0, 40.0), (0.0, 40.0)]
    places = PlacesDrawn({"cam_1": RegionDrawing(False, [upper])})
    told = session.stage(msgspec.structs.replace(request, places=places))["explained"]
    assert not told["person"] and told["why"].startswith("taken out")
    paper = msgspec.structs.replace(request, background="paper")
    with pytest.raises(InputError, match="the method paper has no odds"):
        while not session.stage(paper)["ready"]:
            pass
    with pytest.raises(InputError, match="no camera 'cam_9'"):
        session.stage(msgspec.structs.replace(request, camera="cam_9"))


def test_the_floor_is_drawn_where_the_cameras_see_it():
    rig = ring(3, SIZE, (-0.2, 0.05, 0.0, 0.0))
    lines = ground_lines(rig, UprightFrame.from_up([0, 0, 1], 0.25))
    camera = rig["cam_2"]
    (foot, head), _ = camera.project([[0, 0, 0.25], [0, 0, 2.05]])
    (pole,) = [line["pixels"] for line in lines["cam_2"] if line["kind"] == "pole"]
    assert np.allclose(pole[0], foot, atol=0.01) and np.allclose(pole[-1], head, atol=0.01)
    (z,) = [line["pixels"] for line in lines["cam_2"] if line["kind"] == "z"]
    assert np.allclose(z, camera.project([[0, 0, h / 10] for h in range(11)])[0], atol=0.01)
    best = max(up_choices(rig), key=lambda choice: choice["worth"])
    assert best["name"] == "z" and best["worth"] > 0.99


def test_a_folder_that_fit_refuses_can_be_drawn_on(walk):
    (walk / "calibration.toml").unlink()
    session = opened(walk)
    state = session.state()
    assert state["up"] is None and "holds no calibration" in state["fault"]
    assert state["refused"].keys() == {"points", "floor", "check"}
    session.save(regions(cam_1=RegionDrawing(True, [SQUARE])))
    assert session.picture("cam_1", 0).startswith(b"\xff\xd8")
    with pytest.raises(InputError, match="holds no calibration"):
        session.errors([])
    with pytest.raises(InputError, match="holds no calibration"):
        session.start_check()


def test_cameras_without_pictures_and_folders_of_frames_are_no_hindrance(walk, tmp_path):
    (walk / "cam_2.mp4").unlink()
    folder = OpenedFolder.open(walk)
    assert (
        folder.calibrated and not folder.fault and folder.recording.rig.names == ("cam_1", "cam_3")
    )
    frames = tmp_path / "frames"
    (frames / "masks" / "cam_1").mkdir(parents=True)
    for number in range(3):
        mask = np.zeros((60, 80), np.uint8)
        mask[20:40, 10:30] = number
        cv2.imwrite(str(frames / "masks" / "cam_1" / f"{number}.png"), mask)
    session = opened(frames)
    assert session.state()["refused"].keys() == {"points", "floor", "check", "background"}
    assert session.silhouettes(SilhouetteRequest(2))["ready"] in (True, False)
    with pytest.raises(InputError, match="holds no video"):
        OpenedFolder.open(tmp_path / "frames" / "masks" / "cam_1")


def test_one_camera_has_nothing_to_check(tmp_path):
    session = opened(write_recording(tmp_path / "one", ring(1, SIZE)))
    assert session.state()["refused"].keys() == {"check"}
