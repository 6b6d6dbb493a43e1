"""Distribution of people's poses in pictures, from the simulated motions."""
