"""The commands of the program."""

from mvpose.cli import (
    batch_command,
    calibrate_command,
    detect_command,
    doctor_command,
    estimate_command,
    networks_command,
    repair_command,
    view_command,
)
from mvpose.cli.program import PROGRAM

app = PROGRAM.app()
for command in (estimate_command.estimate, detect_command.detect, detect_command.run, batch_command.batch):
    app.command()(command)
app.add_typer(networks_command.group, name="networks")
for command in (calibrate_command.calibrate, doctor_command.doctor, repair_command.repair, view_command.view):
    app.command()(command)
