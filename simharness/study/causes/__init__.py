"""Causes of a lost score: each is mended alone and together with others, on the same random draws."""
