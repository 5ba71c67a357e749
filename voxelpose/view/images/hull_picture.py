"""Pictures, videos and windows of carved and modelled bodies, by the project's own rasteriser."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.storage.atomic import replacing, write_whole
from silhouette_core.body.model import BodyModel
from silhouette_core.image.raster import render_parts
from silhouette_core.motion import kinematics
from silhouette_core.progress import Reporter
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.hull_mesh import surface
from voxelpose.view.images.canvas import (
    FAINT,
    PEOPLE,
    Colour,
    Image,
    bgr,
    png,
    text_width,
    write_text,
)
from voxelpose.view.images.figure import bone_ends
from voxelpose.view.images.webm import WebmWriter
from voxelpose.view.open3d_import import import_open3d
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.scene import CarvedHull, Scene

SIZE = 480, 720
"""Width and height of a hull's picture from one side, px."""
_BACKGROUND, _BONE = bgr("#f0f4f7"), bgr("#c83c28")
_SKIN = np.array(bgr("#d0bea8"))
_FRONT, _QUARTER, _SIDE = -90, -50, 0  # azimuths, degrees
_CAPTION_PX, _LINE_PX, _MARGIN_PX = 14, 20, 8
_CAPTION = bgr("#2e343c")
_MOST_COLUMNS = 8


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints (J, 3) m, world, not drawn where NaN, numbers (B, 2) of the bones' ends, and the
    bones' colours, BGR; none: all are red.
    """

    joints_m: NDArray[np.float64]
    bones: NDArray[np.integer]
    colours: tuple[Colour, ...] = ()


def hull_picture(
    grid: VoxelGrid,
    occupancy: NDArray[np.bool_],
    skeleton: Skeleton | None = None,
    azimuths_deg: tuple[float, ...] = (-90, -30, 30, 90),
    box_m: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> NDArray[np.uint8]:
    """Pictures (720, 480 * number of sides, 3) uint8, BGR, of the surface of a hull, (nx, ny, nz)
    bool, not empty, from several sides, side by side; needs no screen.

    Args:
        azimuths_deg: position of the viewer, one picture each: 0 is along +x, 90 along +y; -90 is
            before a person that faces -y.
        box_m: lowest and highest corner (3,) of what fills the picture; None: of the hull.
    """
    vertices, faces = surface(*grid.cropped(occupancy))
    box = box_m or (vertices.min(axis=0), vertices.max(axis=0))
    return np.concatenate(
        [shaded_view((vertices, faces), box, skeleton, azimuth, SIZE) for azimuth in azimuths_deg],
        axis=1,
    )


def shaded_view(
    skin: tuple[NDArray[np.float64], NDArray[np.integer]],
    box_m: tuple[NDArray[np.float64], NDArray[np.float64]],
    skeleton: Skeleton | None,
    azimuth_deg: float,
    size: tuple[int, int],
) -> NDArray[np.uint8]:
    """Picture of a `size` (width, height), (height, width, 3) uint8, BGR, of a surface from an
    azimuth as of `hull_picture`, lit from above the viewer's shoulder.

    Args:
        skin: vertices (V, 3) float64, m, and faces (F, 3) int, outward oriented.
        box_m: lowest and highest corner (3,) of what fills the picture.
    """
    (vertices, faces), (low, high), (width, height) = skin, box_m, size
    angle = np.radians(azimuth_deg)
    forward = -np.array([np.cos(angle), np.sin(angle), 0.0])
    camera_from_world = np.stack([np.cross(forward, [0.0, 0.0, 1.0]), [0.0, 0.0, -1.0], forward])
    middle, diagonal = 0.5 * (low + high), float(np.linalg.norm((high - low)[:2]))
    focal = 4.0 * height  # nearly parallel
    # Far enough for the nearest corner to fit into 0.9 of the picture, for any azimuth.
    span = max(float(high[2] - low[2]) / height, diagonal / width)
    distance = 0.5 * diagonal + focal / 0.9 * span
    matrix = np.array([[focal, 0, 0.5 * (width - 1)], [0, focal, 0.5 * (height - 1)], [0, 0, 1]])
    in_camera = (vertices - middle) @ camera_from_world.T + np.array([0, 0, distance])
    labels = np.zeros(len(faces), dtype=np.int32)
    parts, depth = render_parts(in_camera, faces, labels, matrix, size)
    picture = _shade(depth, parts > 0, focal)
    if skeleton is not None:
        joints = (skeleton.joints_m - middle) @ camera_from_world.T + np.array([0, 0, distance])
        pixels = joints[:, :2] / joints[:, 2:] * focal + matrix[:2, 2]
        pixels = np.rint(np.nan_to_num(pixels)).astype(int).tolist()
        for (a, b), colour in _known_bones(skeleton):
            cv2.line(picture, pixels[a], pixels[b], colour, 2, cv2.LINE_AA)
    return picture


def show_hull(
    grid: VoxelGrid, occupancy: NDArray[np.bool_], skeleton: Skeleton | None, title: str
) -> None:
    """Opens a window with the surface of a hull, (nx, ny, nz) bool, not empty, and the skeleton;
    returns when it is closed. InputError where open3d cannot be imported, or there is no screen.
    """
    open3d = import_open3d(screen=True)
    vertices, faces = surface(*grid.cropped(occupancy))
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(vertices), open3d.utility.Vector3iVector(faces)
    )
    if skeleton is None:
        mesh.compute_vertex_normals()
        mesh.paint_uniform_color(_SKIN[::-1] / 255)
        geometries = [mesh]
    else:
        # A closed surface would occlude the lines: it is drawn as a net.
        drawn = _known_bones(skeleton)
        lines = open3d.geometry.LineSet(
            open3d.utility.Vector3dVector(np.nan_to_num(skeleton.joints_m)),
            open3d.utility.Vector2iVector(np.reshape([ends for ends, _ in drawn], (-1, 2))),
        )
        colours = np.reshape([colour[::-1] for _, colour in drawn], (-1, 3)) / 255
        lines.colors = open3d.utility.Vector3dVector(colours)
        net = open3d.geometry.LineSet.create_from_triangle_mesh(mesh)
        net.paint_uniform_color(_SKIN[::-1] / 255)
        geometries = [net, lines]
    open3d.visualization.draw_geometries(geometries, window_name=title)


def _known_bones(skeleton: Skeleton) -> list[tuple[tuple[int, int], Colour]]:
    """Bones both of whose ends are known, and their colours."""
    known = np.isfinite(skeleton.joints_m.sum(axis=1))
    colours = skeleton.colours or (_BONE,) * len(skeleton.bones)
    bones = zip(skeleton.bones.tolist(), colours, strict=True)
    return [((a, b), colour) for (a, b), colour in bones if known[a] and known[b]]


def _shade(
    depth_m: NDArray[np.float32], body: NDArray[np.bool_], focal: float
) -> NDArray[np.uint8]:
    """Shaded image (h, w, 3) uint8 BGR of a depth image (h, w), where `body` is."""
    depth = np.where(body, depth_m, 0.0).astype(np.float64)
    # Smoothed only over the body: depths beside it would tilt the normals at its rim.
    weight = cv2.GaussianBlur(body.astype(np.float64), (0, 0), 1.2)
    smooth = np.where(body, cv2.GaussianBlur(depth, (0, 0), 1.2) / np.maximum(weight, 1e-9), 0.0)
    slope_y, slope_x = (
        np.gradient(smooth, axis=axis) * focal / np.maximum(smooth, 1e-9) for axis in (0, 1)
    )
    normal = np.stack([slope_x, slope_y, -np.ones_like(smooth)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = np.array([-0.4, -0.6, -0.7])
    bright = 0.35 + 0.65 * np.clip(normal @ (light / np.linalg.norm(light)), 0, 1)
    shaded = np.where(body[..., None], bright[..., None] * _SKIN, np.array(_BACKGROUND))
    return shaded.astype(np.uint8)


def hull_of(scene: Scene) -> CarvedHull:
    """The hull of a scene; InputError where there is none."""
    if scene.hull is None:
        raise InputError(f"frame {scene.frame} has no hull: {'; '.join(scene.notes)}")
    return scene.hull


def skeleton_of(scene: Scene) -> Skeleton | None:
    """The fitted skeletons of a scene as one, of several people in their colours; None where there
    is no pose.
    """
    joints, bones, colours, count = [], [], [], 0
    for k, body in enumerate(scene.bodies):
        if body is not None:
            joints.append(body.joints_m)
            bones.append(count + bone_ends(body.bones))
            colours += [PEOPLE[k % len(PEOPLE)]] * len(body.bones)
            count += len(body.joints_m)
    if not joints:
        return None
    many = len(scene.bodies) > 1
    return Skeleton(np.concatenate(joints), np.concatenate(bones), tuple(colours) if many else ())


def write_picture(scenes: ResultScenes, frame: int, path: Path) -> float:
    """Writes hull and skeleton of one frame, from four sides, as PNG; returns the hull's volume,
    litres. InputError where there is no hull to show, or the file cannot be written.
    """
    scene = scenes.scene(frame)
    hull = hull_of(scene)
    write_whole(path, png(hull_picture(hull.grid, hull.occupancy, skeleton_of(scene))))
    return hull.litres(hull.occupancy)


def write_film(scenes: ResultScenes, path: Path, reporter: Reporter) -> int:
    """Writes hull and skeleton of all frames, from three sides that follow one person, as WebM;
    returns the number of frames written: those without a hull are left out. InputError where there
    is nothing to show, or the file cannot be written.
    """
    motions, followed = scenes.motions, scenes.motions[0] if len(scenes.motions) == 1 else None
    if not motions:
        raise InputError(
            f"{scenes.title} is a recording without a fit: --video wants a result; --png shows one"
            " frame's hull"
        )
    reach = [motion.landmarks() for motion in motions]
    if followed is not None:
        reach[0] -= followed.root_m[:, None]
    margin_m = 0.12  # around the joints: flesh, and the excess of the hull
    low = np.min([points.min((0, 1)) for points in reach], axis=0) - margin_m
    high = np.max([points.max((0, 1)) for points in reach], axis=0) + margin_m
    if path.suffix != ".webm":
        raise InputError(f"{path} must end in .webm: that is the format of the video")
    sides = (-90, -30, 30)
    reporter.stage("film", len(scenes.frames))
    with replacing(path) as partial:
        writer = WebmWriter(partial, scenes.fps, (len(sides) * SIZE[0], SIZE[1]))
        try:
            for frame in scenes.frames.tolist():
                scene = scenes.scene(frame)
                if scene.hull is not None:
                    middle = np.zeros(3)
                    if followed is not None:
                        middle = followed.root_m[np.abs(followed.frames - frame).argmin()]
                    box_m, hull = (middle + low, middle + high), scene.hull
                    picture = hull_picture(
                        hull.grid, hull.occupancy, skeleton_of(scene), sides, box_m
                    )
                    caption = f"frame {frame} · {scene.time_s:.2f} s"
                    write_text(picture, caption, 16, picture.shape[0] - 16, 18, FAINT)
                    writer.write(picture)
                reporter.advance()
            if not writer.frames:
                raise InputError(
                    "no frame has a hull: look at the silhouettes with `voxelpose carve`"
                )
            writer.close()
        finally:
            writer.release()
    return writer.frames


def body_picture(body: BodyModel) -> Image:
    """A body at rest from the front, obliquely and the side, and bent: (h, w, 3) uint8, BGR."""
    rest, bent, size = body.vertices_m, bent_vertices(body), (420, 500)
    views = [_body_view(rest, body, azimuth, rest, size) for azimuth in (_FRONT, _QUARTER, _SIDE)]
    return np.concatenate([*views, _body_view(bent, body, _QUARTER, rest, size)], axis=1)


def bodies_picture(bodies: Sequence[BodyModel], captions: Sequence[str]) -> Image:
    """Several bodies from the front, all at the same scale and on the same floor, above two lines
    of text each: (h, w, 3) uint8, BGR, in rows of at most eight.
    """
    size = 230, 270
    tallest = max((body.vertices_m for body in bodies), key=lambda v: float(np.ptp(v[:, 2])))
    cells = []
    for body, caption in zip(bodies, captions, strict=True):
        view = _body_view(body.vertices_m, body, _FRONT, tallest, size)
        lines = caption.split("\n")
        under = np.full((len(lines) * _LINE_PX + _MARGIN_PX, size[0], 3), view[0, 0], np.uint8)
        for k, line in enumerate(lines):
            left = max((size[0] - text_width(line, _CAPTION_PX)) // 2, 0)
            write_text(under, line, left, (k + 1) * _LINE_PX - 4, _CAPTION_PX, _CAPTION)
        cells.append(np.concatenate([view, under]))
    columns = min(len(cells), _MOST_COLUMNS)
    blank = np.full_like(cells[0], cells[0][0, 0])
    cells += [blank] * (-len(cells) % columns)
    rows = [cells[k : k + columns] for k in range(0, len(cells), columns)]
    return np.concatenate([np.concatenate(row, axis=1) for row in rows])


def bent_vertices(body: BodyModel) -> NDArray[np.float64]:
    """Vertices (V, 3) of a body in a pose that bends its large joints, m."""
    angles = np.zeros((1, body.dof_count))
    table = Path(__file__).with_name("bent_pose.toml").read_text(encoding="utf-8")
    for name, degrees in tomllib.loads(table).items():
        angles[0, body.tree.dof_names.index(name)] = np.radians(degrees)
    rotation, origin = kinematics.forward(
        body, body.joints_m[:1], np.array([[1.0, 0.0, 0.0, 0.0]]), angles
    )
    return kinematics.skin(body, rotation[0], origin[0])


def _body_view(
    vertices: NDArray[np.float64],
    body: BodyModel,
    azimuth_deg: float,
    largest: NDArray[np.float64],
    size: tuple[int, int],
) -> Image:
    """One picture, in a frame in which the largest body just fits, on a common floor."""
    floor = np.array([0.0, 0.0, vertices[:, 2].min()])
    reach = np.abs(largest[:, :2]).max()
    box = np.array([-reach, -0.1, 0.0]), np.array([reach, 0.1, np.ptp(largest[:, 2])])
    middle = np.r_[0.5 * (vertices.min(0) + vertices.max(0))[:2], 0.0]
    return shaded_view((vertices - floor - middle, body.faces), box, None, azimuth_deg, size)
