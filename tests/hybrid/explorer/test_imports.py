"""The commands that need no page import nothing of what only the page needs."""

import subprocess
import sys

PROGRAM = """
import sys
import hybrid.__main__
print(sorted({"hypothesis", "lyapunov", "matplotlib", "panel", "pint"} & set(sys.modules)))
"""


def test_commands_without_a_page_are_light():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
