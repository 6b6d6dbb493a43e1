"""The doctor: what is wrong with a rig, from the people in its pictures, and the repair.

The input is a calibration and detections over time; no calibration board and no markers.
"""

from mvpose.calibration.clocks import Clocks, estimate_clocks
from mvpose.calibration.diagnose import diagnose
from mvpose.calibration.findings import Diagnosis, Finding
from mvpose.calibration.repair import Repair, repair
from mvpose.calibration.sightings import Sightings, gather

__all__ = ["Clocks", "Diagnosis", "Finding", "Repair", "Sightings", "diagnose", "estimate_clocks", "gather", "repair"]
