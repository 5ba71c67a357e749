"""Commands of `voxelpose calibrate`."""

from voxelpose.cli.calibrate_board import CalibrateBoard
from voxelpose.cli.calibrate_check import CalibrateCheck
from voxelpose.cli.calibrate_convert import CalibrateConvert
from voxelpose.cli.calibrate_extrinsics import CalibrateExtrinsics
from voxelpose.cli.calibrate_intrinsics import CalibrateIntrinsics
from voxelpose.cli.calibrate_sync import CalibrateSync

SUBCOMMANDS = {
    "board": CalibrateBoard,
    "intrinsics": CalibrateIntrinsics,
    "extrinsics": CalibrateExtrinsics,
    "convert": CalibrateConvert,
    "check": CalibrateCheck,
    "sync": CalibrateSync,
}
