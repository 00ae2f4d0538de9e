"""Rules in force."""
