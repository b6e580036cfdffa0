"""LLVM's instructions for variables, loops and functions of other libraries."""

from contextlib import contextmanager

from llvmlite import ir


def declared(module, kind, name):
    """The function of a name, which is declared in the module if it is not yet."""
    known = module.globals.get(name)
    return ir.Function(module, kind, name) if known is None else known


def variable(builder, value):
    """A place in memory that holds a value; made once, even inside a loop."""
    with builder.goto_entry_block():
        place = builder.alloca(value.type)
    builder.store(value, place)
    return place


@contextmanager
def loop(builder, start, stop, step):
    """A loop as over Python's ``range``: the block writes one turn, for the index that it is given."""
    place = variable(builder, start)
    check, body, after = (builder.append_basic_block(f"loop.{name}") for name in ("check", "body", "after"))
    builder.branch(check)
    with builder.goto_block(check):
        index = builder.load(place)
        ends = [builder.icmp_signed(sign, index, stop) for sign in ("<", ">")]
        upwards = builder.icmp_signed(">", step, step.type(0))
        builder.cbranch(builder.select(upwards, *ends), body, after)
    builder.position_at_end(body)
    yield index
    builder.store(builder.add(index, step), place)
    builder.branch(check)
    builder.position_at_end(after)
