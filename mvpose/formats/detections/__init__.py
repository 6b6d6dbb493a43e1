"""Detections of recordings as labs have them: folders and files of several programs, matched to the cameras of a rig.

:func:`mvpose.formats.detections.recorded_frames.read_recording` goes from paths to the detections of every frame:
:mod:`.sources` finds what belongs to one camera each and matches it to the cameras, one of :mod:`.detection_formats`
reads it, :mod:`.recorded_frames` joins the cameras, and :mod:`.plausibility` refuses what cannot belong to the rig.
"""
