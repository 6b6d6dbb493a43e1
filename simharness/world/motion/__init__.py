"""Motion of people: tracks, activities, recorded motion, and the joint angles that follow from them."""
