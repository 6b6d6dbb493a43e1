"""The simulated world: people, how they move, the room around them, the cameras."""
