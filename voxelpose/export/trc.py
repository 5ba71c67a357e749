"""TRC: marker files of OpenSim and Pose2Sim.

Axis map of written files: x = y, y = z, z = x of the upright frame (y up), metres, as in Pose2Sim:
files of both programs made with one calibration with z up coincide. A person who faces +y faces
OpenSim's +x, as OpenSim's models do.
"""

from pathlib import Path

from silhouette_core.motion.anatomical import LAB_FROM_WORLD
from silhouette_core.motion.motion import Motion
from voxelpose.export.skeleton import ascii_names, every_frame, named_points

_NAMED = "motion.trc"


def write_trc(motion: Motion, path: Path, *, lost_rows: bool = True) -> None:
    """Writes the points of `named_points` as TRC, with the axis map above.

    Frame 1 of the file is frame 0 of the recording.

    Args:
        motion: at least one pose.
        lost_rows: whether frames without a pose have a row. Its cells then hold NaN, which OpenSim
            reads as markers that were not seen (empty cells at the end of a row stop its reader);
            at a frame that shows none its inverse kinematics stop.
    """
    motion = motion.upright()
    words, positions = named_points(motion)
    names = ascii_names(words)
    rows = dict(
        zip(
            motion.frames.tolist(),
            (positions @ LAB_FROM_WORLD.T).reshape(len(motion), -1),
            strict=True,
        )
    )
    frames = every_frame(motion) if lost_rows else motion.frames
    rate = f"{motion.fps:.10g}"
    header = {
        "DataRate": rate,
        "CameraRate": rate,
        "NumFrames": len(frames),
        "NumMarkers": len(names),
        "Units": "m",
        "OrigDataRate": rate,
        "OrigDataStartFrame": frames[0] + 1,
        "OrigNumFrames": len(frames),
    }
    axes = "\t".join(f"{axis}{number}" for number in range(1, len(names) + 1) for axis in "XYZ")
    with path.open("w", encoding="ascii", newline="\n") as file:
        # Not the path's own name, which is another until the file is complete.
        file.write(f"PathFileType\t4\t(X/Y/Z)\t{_NAMED}\n")
        file.write("\t".join(header) + "\n" + "\t".join(map(str, header.values())) + "\n")
        file.write("Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t\n" + f"\t\t{axes}\n\n")
        for frame in frames.tolist():
            cells = (
                [f"{value:.6f}" for value in rows[frame]]
                if frame in rows
                else ["NaN"] * (3 * len(names))
            )
            file.write("\t".join([str(frame + 1), f"{frame / motion.fps:.6f}", *cells]) + "\n")
