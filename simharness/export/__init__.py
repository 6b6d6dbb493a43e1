"""Synthetic benchmarks on disk, in the layout of the CMU Panoptic toolbox, which other people's loaders read."""
