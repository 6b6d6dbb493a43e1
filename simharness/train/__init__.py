"""Training the networks that come with the project, on what the harness renders. Needs the extra ``train``."""
