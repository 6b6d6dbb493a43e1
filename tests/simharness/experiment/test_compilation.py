import numba
import numpy as np
import pytest

from mvpose import Camera, Detections, Pipeline, Rig, affinity
from mvpose.matching import admm, clustering
from mvpose.pipeline import PRESETS
from mvpose.reconstruction import likelihood, pictorial, triangulation
from simharness.experiment.compilation import Compilation, compile_kernels


def signatures():
    """What every kernel of the method that Python calls has been compiled or loaded for, by its name."""
    kernels = {
        f"{module.__name__}.{name}": kernel
        for module in (affinity, admm, clustering, likelihood, triangulation, pictorial)
        for name, kernel in vars(module).items()
        if isinstance(kernel, numba.core.dispatcher.Dispatcher)
    }
    return {name: list(kernel.signatures) for name, kernel in kernels.items() if kernel.signatures}


def test_a_real_frame_finds_everything_compiled():
    compile_kernels(PRESETS)
    before = signatures()
    assert {name.rpartition(".")[2] for name in before} >= {
        "_ray_distance", "_project_and_ascend", "project_in_place", "_propose", "_refine", "_max_product", "_contract"
    }  # fmt: skip
    rng = np.random.default_rng(0)
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    rig = Rig([Camera(K, np.eye(3), [x, 0, 4], [-0.1, 0, 0, 0, 0], (640, 480)) for x in (-1, 0, 1)])
    pixels = rig.project(rng.uniform([-1, -0.8, -0.3], [1, 0.8, 0.3], (4, 17, 3))).reshape(12, 17, 2)
    scores = rng.choice([0.0, 0.5, 1.0], (12, 17))
    for variant in PRESETS:
        Pipeline.preset(variant).estimate(rig, Detections.from_keypoints(np.repeat([0, 1, 2], 4), pixels, scores))
    assert signatures() == before


def test_a_compilation_that_fails_costs_only_the_head_start():
    compilation = Compilation(["no such preset"])
    compilation.start()
    compilation.wait()
    with pytest.raises(ValueError, match="no preset"):
        compile_kernels(["no such preset"])
