"""Confidence intervals, significance tests and breaking points of scores.

The unit of observation is a scene, never a frame: the frames of a scene share its people, cameras and clutter. Several
settings at one seed share much of a scene, too, and an effect in one setting tends to appear in the next. So where a
study has several settings, average them at each seed first and pass the mean of each seed as one scene. A score that
does not apply to a scene is NaN or None, and is ignored.
"""
