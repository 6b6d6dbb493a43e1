"""Two cameras that every calibration format can hold: turned, shifted, with a distorting lens."""

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig

RIG = Rig(
    [
        Camera(
            K=np.array([[500.0 + k, 0, 320], [0, 510, 240], [0, 0, 1]]),
            R=Rotation.from_euler("xyz", [-1.6, 0.2 + k, 0.1]).as_matrix(),
            t=np.array([0.1, 0.2, 4.0 + k]),
            distortion=np.array([-0.1, 0.02, 0.001, -0.002, 0.0]),
            size=(640, 480),
            name=f"c{k}",
        )
        for k in range(2)
    ]
)
