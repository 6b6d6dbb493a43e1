"""Both renderers behind one fixture."""

from __future__ import annotations

import os
from functools import cache

import pytest

from simharness.capture.rendering.raster import make_renderer
from simharness.capture.rendering.renderer import Unavailable


@cache
def _made(name):
    try:
        return make_renderer(name)
    except Unavailable as error:
        return error


def _renderer_or_skip(name):
    made = _made(name)
    if isinstance(made, Unavailable):
        # CI installs the GL libraries and declares it: there, a test that cannot run counts as failed.
        (pytest.fail if os.environ.get("SIMHARNESS_REQUIRE_GL") else pytest.skip)(str(made))
    return made


@pytest.fixture(params=["raster", "gl"])
def renderer(request):
    return _renderer_or_skip(request.param)


@pytest.fixture
def raster():
    return _renderer_or_skip("raster")


@pytest.fixture
def gl():
    return _renderer_or_skip("gl")
