"""Finding out what must not be done: try it, and see whether the expert recovers from it."""
