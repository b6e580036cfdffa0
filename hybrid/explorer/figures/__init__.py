"""The figures of the page: what each is made of, and what new results do to it."""
