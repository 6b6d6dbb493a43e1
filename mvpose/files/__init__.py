"""Files of users: reading within bounds, writing whole or not at all, and messages of one line."""
