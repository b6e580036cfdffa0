"""What a person looks at while a call runs or after it: progress bars, tables of text."""
