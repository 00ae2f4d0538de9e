"""The page Library: what is kept, and what may be done with it."""
