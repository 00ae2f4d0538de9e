"""Several files as one set: a folder, its archive, or files that were given together."""
