"""Memory that is asked for before it is read."""

from typing import Any

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

# Bytes of a line of the cache; where lines are longer, some are asked for twice.
LINE = 64


def prefetch_plain(table: Any, row: Any, offset: Any) -> None:
    """Ask for the line of the cache ``offset`` bytes behind the begin of a row; nothing changes.

    A row at random of a table that fills the caches takes 20 to 100 ns to arrive: a kernel that knows
    early which one it will read does something else meanwhile. In Python this does nothing.

    Parameters
    ----------
    table : array
    row : int
        Within the table.
    offset : int
        Within the row, or the processor asks for other memory, which does no harm.
    """
    del table, row, offset


def _code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kind, (table, row, offset) = signature.args[0], arguments
    array = context.make_array(kind)(context, builder, table)
    stride = cgutils.unpack_tuple(builder, array.strides, kind.ndim)[0]
    pointer, word = ir.IntType(8).as_pointer(), ir.IntType(32)
    shift = builder.add(builder.mul(row, stride), offset)
    address = builder.gep(builder.bitcast(array.data, pointer), [shift])
    form = ir.FunctionType(ir.VoidType(), [pointer, word, word, word])
    ask = cgutils.get_or_insert_function(builder.module, form, "llvm.prefetch.p0i8")
    # To read, into all caches, and it is data.
    builder.call(ask, [address, word(0), word(3), word(1)])
    return context.get_dummy_value()


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    prefetch = prefetch_plain
else:

    @intrinsic
    def prefetch(typing: Any, table: Any, row: Any, offset: Any) -> Any:
        """Do what `prefetch_plain` does."""
        del typing, row, offset
        return types.void(table, types.int64, types.int64), _code
