"""Camera calibrations in the file formats of the field; :mod:`.calibration_formats` reads all of them."""
