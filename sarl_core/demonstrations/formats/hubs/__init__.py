"""Data sets as hubs hand them out: folders with a file that says what is in the others."""
