"""A loop of numba asks for memory before it needs it."""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def prefetch(typingctx, array, row):
    """Ask for the cache line at which a row of an array begins; returns nothing."""
    if not isinstance(array, types.Array) or not isinstance(row, types.Integer):
        return None

    def generate(context, builder, signature, arguments):
        array_type, row_type = signature.args
        view = context.make_array(array_type)(context, builder, arguments[0])
        stride = cgutils.unpack_tuple(builder, view.strides, array_type.ndim)[0]
        index = context.cast(builder, arguments[1], row_type, types.intp)
        byte = ir.IntType(8)
        start = builder.bitcast(view.data, byte.as_pointer())
        place = builder.gep(start, [builder.mul(stride, index)])
        number = ir.IntType(32)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.VoidType(), [byte.as_pointer(), number, number, number]),
            "llvm.prefetch.p0i8",
        )
        # For reading, to be kept in all caches, as data.
        builder.call(function, [place, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, row), generate
