"""Things: what they are made of, how they look, and how each kind is drawn."""
