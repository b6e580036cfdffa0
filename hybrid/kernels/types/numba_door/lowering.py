"""From kernels to LLVM's instructions: half as many as numba itself writes for the same.

Numba prepares for what kernels never do: raise, count references, take negative places from the end of an
array. Its way to ``run.y[i]`` is fifty instructions, most of which LLVM has to remove again; here it is ten.
A place that is not a constant must not be negative.
"""

from collections import Counter

from llvmlite import ir as llvm
from numba.core import types
from numba.core.ir import UNDEFINED, Assign
from numba.core.lowering import Lower

from hybrid.kernels.types.numba_door.arrays import array_of_parts

# Where numba keeps the parts of an array, of a range and of its iterator.
OWNERS = (0, 1)
ITEMS, ITEM_SIZE, DATA, SHAPE, STRIDES = 2, 3, 4, 5, 6
START, STOP, STEP = 0, 1, 2
HERE, LAST, BY = 0, 1, 2
WORD = llvm.IntType(64)
# Bytes of a number.
BYTES_OF_NUMBER = 8
NUMBERS = (types.float64, types.int64)
RANGE, RANGE_ITERATOR = types.range_state64_type, types.range_iter64_type


def array_of(context, builder, kind, data, shape):
    """The value of a contiguous array without an owner.

    ``data`` is the address of its first number, ``shape`` the number of entries along each axis.
    """
    value = builder.insert_value(_without_owner(context.get_value_type(kind), kind.ndim), data, DATA)
    items, stride = shape[0], WORD(BYTES_OF_NUMBER)
    for axis in reversed(range(kind.ndim)):
        value = builder.insert_value(value, shape[axis], (SHAPE, axis))
        if axis < kind.ndim - 1:
            stride = builder.mul(stride, shape[axis + 1])
            value = builder.insert_value(value, stride, (STRIDES, axis))
    for length in shape[1:]:
        items = builder.mul(items, length)
    return builder.insert_value(value, items, ITEMS)


def _without_owner(form, ndim):
    """What is the same in all arrays of a type: functions of the user look for an owner."""
    parts = [llvm.Constant(each, llvm.Undefined) for each in form.elements]
    for place in OWNERS:
        parts[place] = llvm.Constant(form.elements[place], None)
    parts[ITEM_SIZE] = WORD(BYTES_OF_NUMBER)
    strides = [llvm.Constant(WORD, llvm.Undefined)] * (ndim - 1) + [WORD(BYTES_OF_NUMBER)]
    parts[STRIDES] = llvm.Constant(form.elements[STRIDES], strides)
    return llvm.Constant(form, parts)


def handed_over(builder, kind, value):
    """A value as a function of machine code takes it."""
    if not isinstance(kind, types.Array):
        return value
    lengths = [builder.extract_value(value, (SHAPE, axis)) for axis in range(kind.ndim)]
    return array_of_parts(builder, builder.extract_value(value, DATA), lengths)


class KernelLowering(Lower):
    """Lowers a kernel."""

    def init(self):
        """Find the variables that are set once and in the first block: they are known everywhere."""
        super().init()
        counts = Counter(
            each.target.name for block in self.blocks.values() for each in block.find_insts(Assign)
        )
        first = self.blocks[min(self.blocks)]
        self._constants = {
            each.target.name: None for each in first.find_insts(Assign) if counts[each.target.name] == 1
        }
        # The arrays that a block has taken from structures.
        self._fields = {}

    def _alloca_var(self, name, fetype):
        if name not in self._constants:
            super()._alloca_var(name, fetype)

    def loadvar(self, name):
        """The value of a variable."""
        value = self._constants.get(name)
        return super().loadvar(name) if value is None else value

    def storevar(self, value, name, argidx=None):
        """Set a variable."""
        if name in self._constants:
            self._constants[name] = value
        else:
            super().storevar(value, name, argidx)

    def lower_expr(self, resty, expr):
        """The value of an expression."""
        if expr.op == "getattr":
            return self._field(resty, expr)
        if expr.op in ("getitem", "static_getitem"):
            place = expr.index if expr.op == "getitem" else expr.index_var
            if place is not None:
                found = self._item(resty, expr.value, place)
                if found is not None:
                    return found
        if expr.op == "getiter" and resty == RANGE_ITERATOR:
            return self._begin_loop(expr)
        if expr.op == "iternext" and self.typeof(expr.value.name) == RANGE_ITERATOR:
            return self._next_turn(resty, expr)
        if expr.op in ("pair_first", "pair_second"):
            return self.builder.extract_value(self.loadvar(expr.value.name), int(expr.op == "pair_second"))
        return super().lower_expr(resty, expr)

    # Arrays.

    def _field(self, resty, expr):
        """An attribute; the same one of a structure is read once in each block."""
        key = self.builder.block, self.loadvar(expr.value.name), expr.attr
        if not isinstance(resty, types.Array):
            return super().lower_expr(resty, expr)
        value = self._fields.get(key)
        if value is None:
            self._fields[key] = value = super().lower_expr(resty, expr)
        return value

    def _places(self, kind, variable):
        """The places along the first axes of an array; None if the index has no such form."""
        found = self.typeof(variable.name)
        several = isinstance(found, types.BaseTuple)
        parts = list(found) if several else [found]
        if len(parts) > kind.ndim or not all(isinstance(each, types.Integer) for each in parts):
            return None
        if any(isinstance(each, types.IntegerLiteral) and each.literal_value < 0 for each in parts):
            return None
        value = self.loadvar(variable.name)
        values = [self.builder.extract_value(value, i) for i in range(len(parts))] if several else [value]
        return [
            self.context.cast(self.builder, each, part, types.int64)
            for each, part in zip(values, parts, strict=True)
        ]

    def _address(self, array, place):
        """Address of an entry or a row of an array, and the lengths of the row; None if it has none."""
        kind = self.typeof(array.name)
        plain = isinstance(kind, types.Array) and kind.dtype in NUMBERS
        if not plain or not (kind.layout == "C" or kind.ndim == 1):
            return None
        places = self._places(kind, place)
        if places is None:
            return None
        builder, take = self.builder, self.builder.extract_value
        value = self.loadvar(array.name)
        data = take(value, DATA)
        if kind.layout != "C":
            bytes_on = builder.mul(places[0], take(value, (STRIDES, 0)))
            return builder.gep(data, [bytes_on], inbounds=True, source_etype=llvm.IntType(8)), []
        lengths = [take(value, (SHAPE, axis)) for axis in range(1, kind.ndim)]
        offset = places[0]
        for axis, length in enumerate(lengths, 1):
            offset = builder.mul(offset, length)
            if axis < len(places):
                offset = builder.add(offset, places[axis])
        number = self.context.get_data_type(kind.dtype)
        start = builder.gep(data, [offset], inbounds=True, source_etype=number)
        return start, lengths[len(places) - 1 :]

    def _item(self, resty, array, place):
        found = self._address(array, place)
        if found is None:
            return None
        address, lengths = found
        if not lengths:
            dtype = self.typeof(array.name).dtype
            value = self.builder.load(address, typ=self.context.get_data_type(dtype))
            return self.context.cast(self.builder, value, dtype, resty)
        return array_of(self.context, self.builder, resty, address, lengths)

    def lower_setitem(self, target_var, index_var, value_var, signature):
        """Set an entry of an array."""
        kind = self.typeof(value_var.name)
        found = (
            self._address(target_var, index_var) if isinstance(kind, types.Number | types.Boolean) else None
        )
        if found is None or found[1]:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        dtype = self.typeof(target_var.name).dtype
        value = self.context.cast(self.builder, self.loadvar(value_var.name), kind, dtype)
        return self.builder.store(value, found[0])

    # Loops.

    def _range(self, expr):
        values = [
            self.context.cast(self.builder, self.loadvar(each.name), self.typeof(each.name), types.int64)
            for each in expr.args
        ]
        start, stop, step = [*values, WORD(1)][:3] if len(values) > 1 else (WORD(0), *values, WORD(1))
        return self._filled(RANGE, {START: start, STOP: stop, STEP: step})

    def _begin_loop(self, expr):
        builder, bounds = self.builder, self.loadvar(expr.value.name)
        slot = self._slot(WORD)
        builder.store(builder.extract_value(bounds, START), slot)
        stop, step = (builder.extract_value(bounds, each) for each in (STOP, STEP))
        return self._filled(RANGE_ITERATOR, {HERE: slot, LAST: stop, BY: step})

    def _next_turn(self, resty, expr):
        builder, iterator = self.builder, self.loadvar(expr.value.name)
        slot, last, step = (builder.extract_value(iterator, each) for each in (HERE, LAST, BY))
        place = builder.load(slot, typ=WORD)
        rises = builder.icmp_signed(">", step, WORD(0))
        below, above = (builder.icmp_signed(sign, place, last) for sign in "<>")
        goes_on = builder.select(rises, below, above)
        builder.store(builder.add(place, step), slot)
        return self._filled(resty, {0: place, 1: goes_on})

    def _filled(self, kind, parts):
        """A value of a type that is made up of parts."""
        value = llvm.Constant(self.context.get_value_type(kind), llvm.Undefined)
        for place, part in parts.items():
            value = self.builder.insert_value(value, part, place)
        return value

    def _slot(self, kind):
        with self.builder.goto_entry_block():
            return self.builder.alloca(kind)

    # Calls and operators.

    def lower_call(self, resty, expr):
        """The value of a call."""
        return self._range(expr) if resty == RANGE else super().lower_call(resty, expr)

    def _lower_call_normal(self, fnty, expr, signature):
        compiled = None
        if isinstance(fnty, types.Dispatcher):
            compiled = fnty.dispatcher.overloads.get(signature.args)
        if compiled is None:
            return super()._lower_call_normal(fnty, expr, signature)
        arguments = self.fold_call_args(fnty, signature, expr.args, expr.vararg, expr.kws)
        context, builder, described = self.context, self.builder, compiled.fndesc
        context.add_linking_libs([compiled.library])
        convention = context.call_conv
        function = context.declare_function(builder.module, described)
        slot = self._slot(context.data_model_manager[described.restype].get_return_type())
        packed = convention._get_arg_packer(described.argtypes).as_arguments(builder, arguments)
        # Kernels raise nothing, so nobody looks at what the call says of that.
        builder.call(function, [slot, convention._get_excinfo_argument(builder.function), *packed])
        return context.get_returned_value(builder, described.restype, builder.load(slot))

    def _lower_call_ExternalFunctionPointer(self, fnty, expr, signature):
        context, builder = self.context, self.builder
        values = self.fold_call_args(fnty, signature, expr.args, expr.vararg, expr.kws)
        handed = [handed_over(builder, *each) for each in zip(fnty.sig.args, values, strict=True)]
        kind = llvm.FunctionType(context.get_value_type(fnty.sig.return_type), [each.type for each in handed])
        return builder.call(builder.bitcast(self.loadvar(expr.func.name), kind.as_pointer()), handed)

    def lower_binop(self, resty, expr, op):
        """The value of an operator, by the signature that typing has found; numba looks for it again."""
        if not (expr.static_lhs is UNDEFINED and expr.static_rhs is UNDEFINED):
            return super().lower_binop(resty, expr, op)
        context, builder = self.context, self.builder
        signature = self.fndesc.calltypes[expr]
        values = [
            context.cast(builder, self.loadvar(each.name), self.typeof(each.name), kind)
            for each, kind in zip((expr.lhs, expr.rhs), signature.args, strict=True)
        ]
        function = context.typing_context.resolve_value_type(op)
        # Numba may have made the function anew since, without what it knew of this signature.
        context.typing_context.resolve_function_type(function, signature.args, {})
        value = context.get_function(function, signature)(builder, values)
        return context.cast(builder, value, signature.return_type, resty)
