"""What an environment is to us: its names, units and bounds, and what failing means there."""
