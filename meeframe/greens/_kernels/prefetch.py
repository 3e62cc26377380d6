"""A prefetch instruction for compiled code, which loads a cache line of an array before it is needed."""

from llvmlite import ir
from numba import config
from numba.core import types
from numba.extending import intrinsic

_READ, _LOCALITY, _DATA_CACHE = 0, 3, 1


@intrinsic
def prefetch(_context, array, index):
    """Prefetch the cache line of array.flat[index] of a contiguous array, in compiled code.

    The call does not wait. This is the intrinsic of that name of LLVM.

    Parameters
    ----------
    array : ndarray
        C-contiguous array of any shape.
    index : int
        Index of the flattened array; one out of range is harmless.
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
        """Prefetch a cache line in compiled code; do nothing here, since functions are not compiled.

        Parameters
        ----------
        array : ndarray
            C-contiguous array of any shape.
        index : int
            Index of the flattened array.
        """
