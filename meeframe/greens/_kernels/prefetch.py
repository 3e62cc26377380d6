"""A prefetch instruction for compiled code, which loads a cache line of an array before it is needed."""

from llvmlite import ir
from numba import config
from numba.core import types
from numba.extending import intrinsic

_READ, _LOCALITY, _DATA_CACHE = 0, 3, 1


@intrinsic
def prefetch(_context, array, index):
    """Prefetch the cache line of array.flat[index] of a contiguous array, in compiled code.

    The call does not wait, and an index out of range is harmless. This is the intrinsic of that name of LLVM.
    """

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        line = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        flags = [ir.IntType(32)(flag) for flag in (_READ, _LOCALITY, _DATA_CACHE)]
        hint = ir.FunctionType(ir.VoidType(), [line.type] + [flag.type for flag in flags])
        builder.call(builder.module.declare_intrinsic("llvm.prefetch", (line.type,), hint), [line, *flags])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate


if config.DISABLE_JIT:

    def prefetch(array, index):
        """Do nothing, since functions are not compiled."""
