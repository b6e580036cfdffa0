from hybrid.display.tables import html_table, table

ROWS = [("a", "1.5", "x"), ("long", "10", "yy")]


def test_text_is_aligned_to_the_left():
    assert table(("name", "n", "w"), ROWS) == "name  n    w\na     1.5  x\nlong  10   yy"


def test_numbers_are_aligned_to_the_right_but_not_the_first_column():
    shown = table(("name", "n", "w"), ROWS, numbers=True)
    assert shown == "name    n   w\na     1.5   x\nlong   10  yy"


def test_rows_of_an_iterator():
    assert table(("a",), iter([("b",)])) == "a\nb"


def test_html_is_escaped():
    assert html_table(("a<b",), [("1",), ("&",)]) == (
        "<table><thead><tr><th>a&lt;b</th></tr></thead>"
        "<tbody><tr><td>1</td></tr><tr><td>&amp;</td></tr></tbody></table>"
    )
