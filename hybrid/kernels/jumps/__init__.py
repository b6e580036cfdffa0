"""What happens at an instant: resets, saltation, chatter, rest, several transitions at once."""
