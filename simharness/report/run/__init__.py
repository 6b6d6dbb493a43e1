"""The page of one run: plots, pictures, film."""
