"""The screen Demonstrations."""
