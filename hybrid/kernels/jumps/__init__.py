"""What happens at an instant: resets, saltation, rest, several transitions at once."""
