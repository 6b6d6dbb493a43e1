"""Page of the profile of a network: its errors by circumstance, and the check of the profile on other scenes."""
