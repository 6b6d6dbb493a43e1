import pytest

from simharness.reality.detector_fit.shelf_twin import ShelfTwin, film_shelf_twin


@pytest.fixture(scope="session")
def twin() -> ShelfTwin:
    """Twin of Shelf: four people at work, 12 s."""
    return film_shelf_twin(seed=0)
