"""The room itself: floor, walls and light."""
