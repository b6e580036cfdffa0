"""The code of compiled functions as data: terms and statements, written from expressions, with loops."""
