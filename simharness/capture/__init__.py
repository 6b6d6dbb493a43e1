"""What cameras record of the world: pictures, visibility, boxes."""
