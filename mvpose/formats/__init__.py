"""Readers and writers of the file formats of the field: calibrations, 2D detections, tracked people."""
