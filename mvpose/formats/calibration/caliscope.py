"""``camera_array.toml`` of caliscope and other TOML files with a table for each camera: ``x_cam = R X + T``, metres.

Keys are those of :mod:`.opencv`. The writer uses the tables of :mod:`.pose2sim`, which this reader and other programs
read.
"""

from mvpose.formats.calibration import opencv, pose2sim
from mvpose.formats.calibration.calibration_file import CalibrationFormat

FORMAT = CalibrationFormat(
    "caliscope (TOML)",
    lambda file: file.storage is None and bool(opencv.camera_entries(file.toml or {})),
    opencv.read_calibration,
    pose2sim.write_calibration,
)
