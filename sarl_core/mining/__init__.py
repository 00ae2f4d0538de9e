"""From demonstrations to rules."""
