"""What the expert did: the `Demonstrations` type, its checks, its file formats."""
