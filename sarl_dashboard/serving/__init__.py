"""What a server says of itself to whoever runs it."""
