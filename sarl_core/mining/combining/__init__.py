"""Which combinations of two features rules had better ask about."""
