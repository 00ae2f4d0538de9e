"""Rules that a person changed, and what that changed."""
