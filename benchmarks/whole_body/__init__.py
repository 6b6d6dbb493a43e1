"""Running time of hands, face and feet."""
