"""The screen What if."""
