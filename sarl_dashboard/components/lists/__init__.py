"""Long lists: a page of them at a time."""
