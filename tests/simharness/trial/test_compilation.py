"""Compilation of kernels in a second process."""

import importlib
import pkgutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest

import mvpose
from mvpose import Camera, Detections, Rig, preset
from mvpose.presets import NEED_DESCRIPTORS, PRESETS
from simharness.trial.kernel_compilation import Compilation, compile_kernels


def signatures():
    """Return the signatures that every kernel of the method is compiled for, by module and name."""
    compiled = {}
    for each in pkgutil.walk_packages(mvpose.__path__, "mvpose."):
        if not each.name.endswith("__main__"):
            for name, kernel in vars(importlib.import_module(each.name)).items():
                if isinstance(kernel, numba.core.dispatcher.Dispatcher) and kernel.signatures:
                    compiled[kernel.py_func.__module__, name] = list(kernel.signatures)
    return compiled


def test_a_real_frame_compiles_nothing_more():
    rng = np.random.default_rng(0)
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    rig = Rig([Camera(K, np.eye(3), [x, 0, 4], [-0.1, 0, 0, 0, 0], (640, 480)) for x in (-1, 0, 1)])
    pixels = rig.project(rng.uniform([-1, -0.8, -0.3], [1, 0.8, 0.3], (4, 17, 3))).reshape(12, 17, 2)
    scores = rng.choice([0.0, 0.5, 1.0], (12, 17))
    compile_kernels(PRESETS)
    before = signatures()
    for stage in ("rays", "affinity", "matching", "reconstruction"):
        assert any(module.startswith(f"mvpose.{stage}") for module, _ in before), stage
    for variant in PRESETS:
        seen = Detections.from_keypoints(np.repeat([0, 1, 2], 4), pixels, scores)
        preset(variant).estimate(rig, replace(seen, descriptors=rng.random((12, 5))))
        if variant not in NEED_DESCRIPTORS:
            preset(variant).estimate(rig, seen)
    assert signatures() == before


RECONSTRUCTION = """
import test_compilation
from simharness.trial.kernel_compilation import compile_kernels, compile_reconstruction

def of_reconstruction():
    return {key: each for key, each in test_compilation.signatures().items() if "reconstruction" in key[0]}

compile_reconstruction(["full", "track"])
compiled = of_reconstruction()
compile_kernels(["full"])
assert compiled == of_reconstruction(), "the method needs other kernels, or for other arguments"
assert ("mvpose.reconstruction.pictorial", "_structures") in compiled
"""


@pytest.mark.slow
def test_reconstruction_alone_is_compiled_for_what_the_method_gives_it():
    """In a process of its own, in which nothing is compiled yet."""
    subprocess.run([sys.executable, "-c", RECONSTRUCTION], check=True, cwd=Path(__file__).parent)


@pytest.mark.slow
def test_a_failed_compilation_does_not_end_the_run():
    compilation = Compilation(["no such preset"])
    compilation.start()
    compilation.wait()
    with pytest.raises(ValueError, match="unknown preset"):
        compile_kernels(["no such preset"])


PICTURES = """
from numba.core.dispatcher import Dispatcher
from simharness.capture.rendering import finishes, light_kernels, moving_light, moving_shadows
from simharness.capture.rendering import shaded_pixels, shading_kernels
from simharness.scenario.load import load
from simharness.trial.kernel_compilation import compile_pictures
from simharness.trial.run_trial import run_trial

def of_pictures():
    modules = finishes, light_kernels, moving_light, moving_shadows, shaded_pixels, shading_kernels
    kernels = [each for module in modules for each in vars(module).values() if isinstance(each, Dispatcher)]
    return {each.py_func.__qualname__: list(each.signatures) for each in kernels}

compile_pictures()
compiled = of_pictures()
for kernel in ("shade_lit", "cast", "dim", "moving_light", "probe_light"):
    assert compiled[kernel], kernel
run_trial(load("quickstart", overrides=["duration=0.1"]), until="detect", previews=[0])
assert compiled == of_pictures(), "pictures need other kernels, or for other arguments"
"""


@pytest.mark.slow
def test_pictures_are_compiled_for_what_a_scene_gives_them():
    """In a process of its own, in which nothing is compiled yet."""
    subprocess.run([sys.executable, "-c", PICTURES], check=True, cwd=Path(__file__).parent)
