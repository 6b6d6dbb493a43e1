"""The commands of the program."""

from mvpose.cli import detect_command, doctor_command, estimate_command, networks_command, repair_command, view_command
from mvpose.cli.program import PROGRAM

app = PROGRAM.app()
estimate_command.add_to(app)
detect_command.add_to(app)
networks_command.add_to(app)
doctor_command.add_to(app)
repair_command.add_to(app)
view_command.add_to(app)
