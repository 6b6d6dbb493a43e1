"""People: bodies, their looks, and their MuJoCo models."""
