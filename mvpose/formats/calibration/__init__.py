"""Camera calibrations in the file formats of the field; :mod:`.registry` reads all of them."""
