"""Rules that forbid: what the expert does not do where it could."""
