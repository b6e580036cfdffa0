"""Where jumps that follow each other ever faster lead: when their limit is known, and the jump to it."""
