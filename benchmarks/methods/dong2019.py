"""Dong et al., CVPR 2019, as its authors released it, from the stages of :mod:`mvpose`.

The paper's geometric affinity, distances of joints from epipolar lines in pixels, with appearance where detections have
descriptors; its matching of all views with cycle consistency; and the triangulation of the released code, the pair of
views with the least reprojection error over all views. Beside it, ``full`` shows what this project changed: affinity by
viewing rays, and a pictorial structure with an error model.
"""

from mvpose import Pipeline
from mvpose.affinity import EpipolarAffinity, FusedAffinity
from mvpose.matching import Matcher
from mvpose.reconstruction import Triangulation

estimator = Pipeline(FusedAffinity(geometry=EpipolarAffinity()), Matcher("admm"), Triangulation("best-pair"))
