"""What the server reads from an address."""

from tornado.escape import parse_qs_bytes

from hybrid.explorer.server import read_query


def test_names_and_values_of_an_address_may_be_of_any_alphabet():
    assert read_query(parse_qs_bytes("p.%CE%B2=0.2&section=%CE%B8")) == {"p.β": "0.2", "section": "θ"}


def test_bytes_that_are_no_text_are_read_all_the_same():
    assert set(read_query(parse_qs_bytes("level=%ff&%ff=1"))) == {"level", "\ufffd"}
