"""A page to play with: sliders, pictures that follow them, and the script that gives the same pictures."""
