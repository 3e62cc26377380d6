"""A hint to the processor: fetch a line of an array into the caches before it is needed."""

from llvmlite import ir
from numba import config
from numba.core import types
from numba.extending import intrinsic

_READ, _KEEP, _DATA = 0, 3, 1


@intrinsic
def prefetch(_context, array, index):
    """Prefetch, in compiled code, the cache line that holds array.flat[index] of a contiguous array.

    An index out of range does no harm, and nothing waits. Source: LLVM's intrinsic of that name.
    """

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        line = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        flags = [ir.IntType(32)(flag) for flag in (_READ, _KEEP, _DATA)]
        hint = ir.FunctionType(ir.VoidType(), [line.type] + [flag.type for flag in flags])
        builder.call(builder.module.declare_intrinsic("llvm.prefetch", (line.type,), hint), [line, *flags])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate


if config.DISABLE_JIT:

    def prefetch(array, index):
        """Do nothing, where functions are not compiled."""
