"""Methods of others for the leaderboard, each a user-defined estimator in one file.

They are written again from the papers, or call packages of others; the docstring of each file says which, and what it
leaves out. All get viewing rays from the same adapter (:func:`mvpose.rays.viewing_rays`), so that lenses and missing
keypoints mean the same to all of them. Constants are those of the papers and of the published defaults. Those that are
not published are the files' own; some were chosen by PCP on held-out scenes, and their docstrings say so. These are
``quickstart`` with the detectors ``typical`` and ``poor`` at seeds 900 to 905, which the leaderboard does not score.
"""
