"""What whoever runs a dashboard for others says: what they may use, and how much of it."""
