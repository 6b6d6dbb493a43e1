"""Readers of the true joints of recordings; :mod:`mvpose.formats` reads calibrations and detections."""
