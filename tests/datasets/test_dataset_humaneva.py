"""HumanEva: .cal, .ofs, C3D of Plug-in Gait markers, .mp."""

import ezc3d
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.datasets.miniatures import FIGURE, POINTS, SIZE, looking, opened, write_video
from voxelpose import Recording
from voxelpose.recording.truth import read_truth

FRAMES = 12
MOCAP = 60
CLIP = ("--subject", "S1", "--action", "Walking", "--trial", "1")
SEGMENTS = ("PEL", "TRX", "HED", "LFE", "LTI", "RFE", "RTI")
SEGMENTS += ("LCL", "LHU", "LRA", "RCL", "RHU", "RRA")
FC, CC, SKEW, KC = (70.0, 69.0), (31.0, 23.0), 0.01, (-0.2, 0.1, 0.003, -0.002, 0.01)


def formula(number: int) -> np.ndarray:
    """Bouguet's project_points2: mm, R X + T."""
    rotation, translation = looking(number)
    x = 1000 * POINTS @ rotation.T + 1000 * translation
    a, b = x[:, 0] / x[:, 2], x[:, 1] / x[:, 2]
    r2 = a**2 + b**2
    radial = 1 + KC[0] * r2 + KC[1] * r2**2 + KC[4] * r2**3
    xd = a * radial + 2 * KC[2] * a * b + KC[3] * (r2 + 2 * a**2)
    yd = b * radial + KC[2] * (r2 + 2 * b**2) + 2 * KC[3] * a * b
    return np.column_stack([FC[0] * (xd + SKEW * yd) + CC[0], FC[1] * yd + CC[1]])


def frame(segment: str, time: int) -> np.ndarray:
    """A segment's place and axes at a time, (4, 4), mm: it moves along y by 5 mm per time."""
    number = SEGMENTS.index(segment)
    result = np.eye(4)
    result[:3, :3] = Rotation.from_euler("xyz", [0.1 * number, 0.2, 0.05 * number]).as_matrix()
    places = {"PEL": (0, 0, 950), "TRX": (10, 5, 1430), "HED": (20, 0, 1600)}
    sides = {"FE": (100, 0, 500), "TI": (110, 0, 90), "CL": (180, 0, 1420), "HU": (220, 0, 1120)}
    sides |= {"RA": (230, -30, 870)}
    place = places.get(segment) or sides[segment[1:]]
    result[:3, 3] = np.array(place) * ((-1 if segment[0] == "R" else 1), 1, 1) + (0, 5 * time, 0)
    return result


def markers(times: range) -> dict[str, np.ndarray]:
    """Virtual markers in Vicon's order, origin and ends of the z, x and y axes; then real ones."""
    positions: dict[str, list] = {}
    for time in times:
        for segment in SEGMENTS:
            pose = frame(segment, time)
            for letter, axis in zip("OPAL", (None, 2, 0, 1), strict=True):
                end = pose[:3, 3] + (0 if axis is None else 100 * pose[:3, axis])
                if segment in ("LFE", "RFE") and letter == "P":
                    end = pose[:3, 3] + 400 * pose[:3, 2]
                positions.setdefault(segment + letter, []).append(end)
        positions.setdefault("LSHO", []).append(np.array([200.0, 0, 1450]))
        positions.setdefault("RSHO", []).append(np.array([-200.0, 0, 1450]))
    return {name: np.array(of_time) for name, of_time in positions.items()}


def write_c3d(file, times: range, lost: int | None = None) -> None:
    positions = markers(times)
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    content["parameters"]["POINT"]["LABELS"]["value"] = [f"Subject:{name}" for name in positions]
    points = np.ones((4, len(positions), len(times)))
    points[:3] = np.moveaxis(np.array(list(positions.values())), 2, 0)
    if lost is not None:
        points[:3, 0, lost] = 0
    content["data"]["points"] = points
    content.write(str(file))


def turned_y(angle: float) -> np.ndarray:
    """yRotation.m of the support code."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, -s, 0], [0, 1, 0, 0], [s, 0, c, 0], [0, 0, 0, 1]])


def at(pose: np.ndarray, *local: float) -> np.ndarray:
    return (pose @ [*local, 1])[:3]


def joints(time: int) -> dict[str, np.ndarray]:
    """The body_pose of cur_frame.m, mm."""
    pose = {segment: frame(segment, time) for segment in SEGMENTS}
    origin = {segment: of[:3, 3] for segment, of in pose.items()}
    trunk = np.linalg.norm(origin["TRX"] - origin["PEL"])
    back = np.eye(4)
    back[0, 3] = -50
    pelvis = pose["PEL"] @ back @ turned_y(np.arctan2((400 / 2 - 7) / 2, trunk))
    head = pose["HED"].copy()
    head[:3, 3] = origin["TRX"]
    positions = {"pelvis": at(pelvis, 0, 0, 0), "neck": at(pelvis, 0, 0, trunk)}
    positions["head_top"] = at(head, 0, 0, 316.103)
    for side, letter, offset in (("left", "L", 40.0), ("right", "R", 50.0)):
        positions[f"{side}_hip"] = origin[f"{letter}FE"] + 400 * pose[f"{letter}FE"][:3, 2]
        positions[f"{side}_knee"] = origin[f"{letter}FE"]
        positions[f"{side}_ankle"] = origin[f"{letter}TI"]
        shoulder, elbow = pose[f"{letter}HU"].copy(), pose[f"{letter}RA"].copy()
        shoulder[:3, 3], elbow[:3, 3] = origin[f"{letter}CL"], origin[f"{letter}HU"]
        upper = np.linalg.norm(origin[f"{letter}HU"] - origin[f"{letter}CL"])
        lower = np.linalg.norm(origin[f"{letter}RA"] - origin[f"{letter}HU"])
        difference = at(elbow, 0, 0, 0) - at(shoulder, 0, 0, -upper)
        shoulder = shoulder @ turned_y(-np.arctan2(offset / 2, upper))
        elbow[:3, 3] = at(shoulder, 0, 0, -upper) + difference
        elbow = elbow @ turned_y(np.arctan2(offset / 2, upper))
        positions[f"{side}_shoulder"] = origin[f"{letter}CL"]
        positions[f"{side}_elbow"] = at(shoulder, 0, 0, -upper)
        positions[f"{side}_wrist"] = at(elbow, 0, 0, -lower)
    return positions


@pytest.fixture
def source(tmp_path):
    root = tmp_path / "HumanEva"
    folder = root / "S1"
    for kind in ("Calibration_Data", "Sync_Data", "Mocap_Data"):
        (folder / kind).mkdir(parents=True)
    # The third frame of C2 was taken when the first of C1 was: frame 11.5 of the motion capture.
    for number, (name, offset, frames) in enumerate((("C1", 1, FRAMES), ("BW1", 3, FRAMES + 2))):
        rotation, translation = looking(number)
        values = [*FC, *CC, SKEW, *KC, *rotation.ravel(), *(1000 * translation)]
        text = "\n".join(f"{value:.9f}" for value in values)
        (folder / "Calibration_Data" / f"{name}.cal").write_text(text)
        (folder / "Sync_Data" / f"Walking_1_({name}).ofs").write_text(f"{offset}\n11.5\n2.0\n")
        write_video(folder / "Image_Data" / f"Walking_1_({name}).avi", frames, 60)
        write_video(root / "Background" / f"Background_1_({name}).avi", 3, 60)
    write_c3d(folder / "Mocap_Data" / "Walking_1.c3d", range(MOCAP))
    write_c3d(folder / "Mocap_Data" / "Static.c3d", range(3))
    sizes = "$Bodymass = 70\n$LShoulderOffset = 40.0\n$RShoulderOffset = 50.0\n"
    (folder / "Mocap_Data" / "S1.mp").write_text(sizes)
    return root


def test_pixels_backgrounds_and_synchronous_frames(source, tmp_path, convert):
    out = tmp_path / "out"
    convert("humaneva", source, out, *CLIP)
    recording = opened(out, {"cam_C1": formula(0), "cam_BW1": formula(1)})
    assert recording.frame_count == FRAMES and recording.fps == pytest.approx(60, rel=1e-4)
    assert set(recording.backgrounds()) == {"cam_C1", "cam_BW1"}
    assert {camera.size for camera in recording.rig} == {SIZE}
    _, _, pictures = next(iter(recording))
    # The videos become lighter by 10 per frame, so BW1 has to be 20 lighter.
    lighter = pictures["cam_BW1"].mean() - pictures["cam_C1"].mean()
    assert lighter == pytest.approx(20, abs=3)


def test_truth(source, tmp_path, convert):
    convert("humaneva", source, tmp_path / "out", *CLIP)
    truth = read_truth(tmp_path / "out" / "truth.json")
    assert truth.shape == (FRAMES, 15, 3)
    assert np.isnan(truth[:5]).all()
    for row in range(5, FRAMES):
        before = 10 + 2 * row  # frame 11.5, counted from 1, is half-way between 10 and 11 from 0
        early, late = joints(before), joints(before + 1)
        expected = np.array([(early[name] + late[name]) / 2 for name in FIGURE]) / 1000
        np.testing.assert_allclose(truth[row], expected, atol=2e-6)


def test_lost_markers_and_clips_without_motion_capture(source, tmp_path, convert):
    mocap = source / "S1" / "Mocap_Data"
    write_c3d(mocap / "Walking_1.c3d", range(MOCAP), lost=24)
    convert("humaneva", source, tmp_path / "a", *CLIP, "--cameras", "C1")
    truth = read_truth(tmp_path / "a" / "truth.json")
    known = np.isfinite(truth).all(axis=(1, 2))
    np.testing.assert_array_equal(np.flatnonzero(~known), [0, 1, 2, 3, 4, 7])
    (mocap / "Walking_1.c3d").unlink()
    convert("humaneva", source, tmp_path / "b", *CLIP)
    assert not (tmp_path / "b" / "truth.json").exists()


def test_cut_frames_are_synchronous(source, tmp_path, convert):
    convert("humaneva", source, tmp_path / "out", *CLIP, "--frames", "6:9")
    recording = Recording.open(tmp_path / "out")
    assert recording.frame_count == 3
    _, _, pictures = next(iter(recording))
    assert pictures["cam_BW1"].mean() - pictures["cam_C1"].mean() == pytest.approx(20, abs=3)
    assert pictures["cam_C1"].mean() == pytest.approx(100, abs=3)
    truth = read_truth(tmp_path / "out" / "truth.json")
    early, late = joints(22), joints(23)
    expected = (early["left_knee"] + late["left_knee"]) / 2000
    np.testing.assert_allclose(truth[0, list(FIGURE).index("left_knee")], expected, atol=2e-6)


def test_mistakes(source, tmp_path, refuse):
    out, folder = tmp_path / "out", source / "S1"
    assert "it has S1" in refuse("humaneva", source, out, "--subject", "S9", "--action", "Jog")
    assert "no camera of Jog_1" in refuse("humaneva", source, out, *CLIP, "--action", "Jog")
    cal = folder / "Calibration_Data" / "BW1.cal"
    cal.write_text("\n".join(cal.read_text().split()[:20]))
    assert "must be 22 numbers, got 20" in refuse("humaneva", source, out, *CLIP)
    (folder / "Mocap_Data" / "S1.mp").unlink()
    assert "S1.mp is missing" in refuse("humaneva", source, out, *CLIP, "--cameras", "C1")
    motion = folder / "Mocap_Data" / "Walking_1.c3d"
    motion.write_bytes(motion.read_bytes()[:100])
    assert "cannot be read as C3D" in refuse("humaneva", source, out, *CLIP, "--cameras", "C1")
    (folder / "Sync_Data" / "Walking_1_(C1).ofs").unlink()
    assert "(C1).ofs is missing" in refuse("humaneva", source, out, *CLIP)
