"""What the commands answer."""
