"""Camera calibrations in the field's file formats."""
