"""Pictures of the pages of mvpose for the guide."""
