import pytest

from simharness.reality.detector_fit.shelf_twin import Twin, film_twin


@pytest.fixture(scope="session")
def twin() -> Twin:
    """Four people at work on the rig of Shelf, 12 s of them."""
    return film_twin(seed=0)
