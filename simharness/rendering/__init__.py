"""Pictures of the scene and what they say about the truth: renderers, visibility, films, drawings."""
