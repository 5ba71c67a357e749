"""Small calibrations, most of them of formats that are read only, for `benchmarks.fuzz_targets`."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.io import savemat

from benchmarks.scene import ring
from calib.camera import Rig

_POSE = [[1, 0, 0, 0.5], [0, 0, -1, -3], [0, 1, 0, 1.2], [0, 0, 0, 1]]
_XCP = """<?xml version="1.0"?>
<Cameras>
 <Camera DEVICEID="7" TYPE="Vero2.2" SENSOR_SIZE="2048 1088"/>
 <Camera DEVICEID="21" TYPE="Vue_VIDEO" SENSOR_SIZE="320 240" PIXEL_ASPECT_RATIO="1">
  <KeyFrames><KeyFrame FRAME="0" FOCAL_LENGTH="300" PRINCIPAL_POINT="159 120"
   POSITION="100 -3000 1200" ORIENTATION="0.7 0.01 0.02 0.71"
   VICON_RADIAL2="Vicon3Parameter 159 120 1e-8 1e-14 0"/></KeyFrames>
 </Camera>
</Cameras>
"""
_THEIA = """<calibration><results/><cameras>
 <camera active="1" serial="21" viewrotation="0">
  <transform x="500" y="1200" z="3000" r11="1" r12="0" r13="0" r21="0" r22="0" r23="-1" r31="0"
   r32="1" r33="0"/>
  <intrinsic sensorMinU="0" sensorMaxU="320" sensorMinV="0" sensorMaxV="240" focalLengthU="300"
   focalLengthV="301" centerPointU="160" centerPointV="120" skew="0" radialDistortion1="-0.1"/>
 </camera></cameras></calibration>
"""
_METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk label="Chunk 1">
 <sensors><sensor id="0" type="frame"><resolution width="320" height="240"/>
  <calibration type="frame" class="adjusted"><resolution width="320" height="240"/>
   <f>300</f><cx>1</cx><cy>-2</cy><b1>0.1</b1><b2>0.2</b2><k1>-0.1</k1><p1>0.001</p1>
  </calibration></sensor></sensors>
 <cameras><camera id="0" sensor_id="0" label="cam_0">
  <transform>1 0 0 0.5 0 0 -1 -3 0 1 0 1.2 0 0 0 1</transform></camera></cameras>
 <transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>0 0 1</translation>
  <scale>2</scale></transform>
</chunk></document>
"""


@cache
def small_rig() -> Rig:
    """Two cameras, of which the first has a distorting lens."""
    lenses = [(0.1, -0.05, 0.001, -0.002, 0.01), ()]
    return Rig(
        tuple(
            replace(camera, distortion=np.array(lens))
            for camera, lens in zip(ring(2, (320, 240)), lenses, strict=True)
        )
    )


def write_vicon(path: Path) -> None:
    """Writes a rig of a marker camera and a video camera."""
    path.write_text(_XCP)


def write_theia(path: Path) -> None:
    """Writes one camera as Theia3D does."""
    path.write_text(_THEIA)


def write_metashape(path: Path) -> None:
    """Writes a chunk with a transform of its own."""
    path.write_text(_METASHAPE)


def write_colmap(path: Path) -> None:
    """Writes a text model of two pictures."""
    path.mkdir()
    lenses = "1 OPENCV 320 240 300 301 160 120 -0.1 0.01 0.001 0\n2 OPENCV_FISHEYE 320 240"
    (path / "cameras.txt").write_text(f"# cameras\n{lenses} 300 301 160 120 0 0 0 0\n")
    poses = "1 0.7 0.7 0 0 0 1 3 1 cam_0.png\n1 2 -1\n2 0.5 0.5 0.5 0.5 0 1 4 2 cam_1.png\n\n"
    (path / "images.txt").write_text(f"# images\n{poses}")


def write_nerfstudio(path: Path) -> None:
    """Writes two frames, one with a lens of its own."""
    lens = {"fl_x": 300, "fl_y": 301, "cx": 160, "cy": 120, "w": 320, "h": 240, "k1": -0.1}
    frames = [{"file_path": f"a/{name}.png", "transform_matrix": _POSE} for name in ("one", "two")]
    frames[1] |= {"fl_x": 310, "camera_model": "OPENCV_FISHEYE"}
    content = {"camera_model": "OPENCV", **lens, "frames": frames}
    path.write_text(json.dumps(content))


def write_kinect(path: Path) -> None:
    """Writes the colour camera of a device."""
    numbers = [0.5, 0.5, 0.5, 0.65, 0.3, -2, 1.4, 0.2, -2, 1.3, 0, 0, 0.001, -0.001]
    lens = {"ModelParameters": numbers, "ModelType": "CALIBRATION_LensDistortionModelBrownConrady"}
    camera = {"Purpose": "CALIBRATION_CameraPurposePhotoVideo", "Intrinsics": lens}
    content = {"CalibrationInformation": {"Cameras": [camera]}}
    path.write_text(json.dumps(content))


def write_dannce(path: Path) -> None:
    """Writes two cameras as MATLAB does."""
    camera = {
        "K": np.array([[300, 0, 161], [0, 301, 121], [0, 0, 1.0]]).T,
        "r": np.array([row[:3] for row in _POSE[:3]], float).T,
        "t": [[500.0, -3000, 1200]],
        "RDistort": [[-0.1, 0.01]],
        "TDistort": [[0.001, 0.001]],
    }
    params, names = np.empty((2, 1), object), np.empty((1, 2), object)
    params[:, 0], names[0] = [camera, camera], ["Camera1", "Camera2"]
    savemat(path, {"params": params, "camnames": names})


def write_opencap(path: Path) -> None:
    """Writes two cameras by name."""
    camera = {
        "intrinsicMat": [[300, 0, 160], [0, 301, 120], [0, 0, 1]],
        "distortion": [[-0.1, 0.01, 0.001, 0.001, 0]],
        "imageSize": [[240], [320]],
        "rotation": [row[:3] for row in _POSE[:3]],
        "translation": [[500], [-3000], [1200]],
    }
    path.write_text(json.dumps({"Cam0": camera, "Cam1": camera}))
