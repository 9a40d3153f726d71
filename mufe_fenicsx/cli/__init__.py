"""The command `mufe`: its commands, what they print, and how it ends."""
