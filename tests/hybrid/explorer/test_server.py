"""When the server listens, and what it reads from an address."""

import socket
from urllib.parse import urlparse

from tornado.escape import parse_qs_bytes

import hybrid
import models
from hybrid.explorer.server import read_query


def test_a_page_can_be_reached_as_soon_as_its_address_is_known():
    for _ in range(3):
        explorer = hybrid.explore(models.bouncing_ball(), (1.0, 0.0), block=False)
        address = urlparse(explorer.url)
        socket.create_connection((address.hostname, address.port), timeout=5.0).close()
        explorer.stop()


def test_names_and_values_of_an_address_may_be_of_any_alphabet():
    assert read_query(parse_qs_bytes("p.%CE%B2=0.2&section=%CE%B8")) == {"p.β": "0.2", "section": "θ"}


def test_bytes_that_are_no_text_are_read_all_the_same():
    assert set(read_query(parse_qs_bytes("level=%ff&%ff=1"))) == {"level", "\ufffd"}
