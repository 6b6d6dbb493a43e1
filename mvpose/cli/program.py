"""The program ``mvpose``."""

from mvpose.commands.programs import Program


def _version() -> str:
    from mvpose.report.documents import program_version

    return program_version()


PROGRAM = Program(
    "mvpose",
    "Make 3D poses of several people from recordings of calibrated cameras, and check the calibration.",
    version=_version,
    left="nothing was written",
)
