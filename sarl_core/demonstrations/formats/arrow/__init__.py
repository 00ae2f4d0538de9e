"""Arrow: its files and streams, and columns that hold several numbers in each row."""
