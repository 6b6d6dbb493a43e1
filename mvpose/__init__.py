"""Multi-person 3D pose estimation from a few calibrated cameras (Dong et al., CVPR 2019); needs no GPU."""

from mvpose.public_names import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
